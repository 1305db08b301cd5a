from __future__ import annotations

import numpy as np
import pytest

from koopcli.koopman.modes import Modes, newton_couplings
from koopcli.koopman.predictor import TABLES

RATES = np.array([0.0, -1 + 5j, -1 - 5j, -0.5])


@pytest.fixture(params=[4, 1], ids=["every state set", "first states set"])
def parts(request):
    rng = np.random.default_rng(0)
    modes = Modes(RATES, newton_couplings(RATES, 1.0), copies=5, dt=0.02)
    return rng.uniform(-1, 1, (7, 11, 3)), rng.standard_normal((7, 5, request.param)), modes


@pytest.fixture(params=TABLES)
def lift(request, parts):
    return TABLES[request.param](*parts)


def test_at_a_tabulated_sample_it_is_the_initial_lifted_state_carried_on(lift, parts):
    states, starts, modes = parts
    first = np.zeros((7, 5, 4))
    first[:, :, : starts.shape[2]] = starts
    A = np.kron(np.eye(5), modes.block)
    z = first.reshape(7, 20)
    for k in range(11):
        assert lift.lift(states[:, k]) == pytest.approx(z, rel=1e-11, abs=1e-12)
        z = z @ A.T


def test_nearest_by_brute_force(lift, parts):
    states = parts[0]
    x = np.random.default_rng(1).uniform(-1.5, 1.5, (300, 3))
    distance = np.linalg.norm(x[:, None] - states.reshape(-1, 3), axis=2)
    j, k = lift.nearest(x)
    assert (j * 11 + k == distance.argmin(axis=1)).all()


def test_observing_is_lifting_and_multiplying(lift):
    rng = np.random.default_rng(2)
    x, rows = rng.uniform(-1, 1, (40, 3)), rng.standard_normal((6, 20))
    assert lift.observe(x, rows) == pytest.approx(lift.lift(x) @ rows.T, rel=1e-12, abs=1e-12)
    assert lift.onto(rows)(x) == pytest.approx(lift.observe(x, rows), rel=1e-12, abs=1e-12)
    assert lift.functions == 20


def test_it_survives_storage(lift, parts):
    again = TABLES[lift.kind].unpack(lift.pack(), parts[2])
    x = np.random.default_rng(3).uniform(-1, 1, (40, 3))
    assert (again.lift(x) == lift.lift(x)).all()


def test_what_is_not_finite_is_looked_up_somewhere(lift):
    x = np.array([[np.nan, 0, 0], [np.inf, 1, 1], [0.1, 0.2, 0.3]])
    assert np.isfinite(lift.lift(x)).all()
