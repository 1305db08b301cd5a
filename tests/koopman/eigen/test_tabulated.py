from __future__ import annotations

import numpy as np
import pytest

from koopcli.koopman.eigen.lookup.lookup import Lift
from koopcli.koopman.eigen.nodes import Search, nodes_of
from koopcli.koopman.eigen.tabulated import Tabulated
from koopcli.koopman.predictor.modes import Modes, newton_couplings

RATES = np.array([0.0, -1 + 5j, -1 - 5j, -0.5])


@pytest.fixture(params=[4, 1], ids=["every state set", "first states set"])
def parts(request):
    rng = np.random.default_rng(0)
    modes = Modes(RATES, newton_couplings(RATES, 1.0), copies=5, dt=0.02)
    return rng.uniform(-1, 1, (7, 11, 3)), rng.standard_normal((7, 5, request.param)), modes


@pytest.fixture(params=Lift.kinds().values())
def lift(request, parts):
    states, starts, modes = parts
    return Tabulated(states, nodes_of(states, 11, Search(request.param(), np.array([1.0, 2.0, 0.5]))), starts, modes)


def test_at_a_tabulated_sample_it_is_the_initial_lifted_state_carried_on(lift, parts):
    if lift.nodes.search.lift.kind == "mls":
        pytest.skip("moving least squares do not meet their nodes")
    states, starts, modes = parts
    first = np.zeros((7, 5, 4))
    first[:, :, : starts.shape[2]] = starts
    A = np.kron(np.eye(5), modes.block)
    z = first.reshape(7, 20)
    exact = lift.nodes.search.lift.kind in ("nearest", "linear")
    for k in range(11):
        assert lift.lift(states[:, k]) == pytest.approx(z, rel=1e-9, abs=1e-9 if exact else 1e-4)
        z = z @ A.T


def test_observing_is_lifting_and_multiplying(lift):
    rng = np.random.default_rng(2)
    x, rows = rng.uniform(-1, 1, (40, 3)), rng.standard_normal((6, 20))
    assert lift.observe(x, rows) == pytest.approx(lift.lift(x) @ rows.T, rel=1e-9, abs=1e-9)
    assert lift.onto(rows)(x) == pytest.approx(lift.observe(x, rows), rel=1e-9, abs=1e-9)
    assert lift.functions == 20


def test_it_survives_storage(lift, parts):
    again = Tabulated.unpack(lift.pack(), parts[2])
    x = np.random.default_rng(3).uniform(-1, 1, (40, 3))
    assert (again.lift(x) == lift.lift(x)).all()


def test_what_is_not_finite_has_no_lifted_state(lift):
    x = np.array([[np.nan, 0, 0], [np.inf, 1, 1], [0.1, 0.2, 0.3]])
    found = lift.lift(x)
    assert np.isnan(found[:2]).all()
    assert found[2] == pytest.approx(lift.lift(x[2:])[0], rel=1e-9)
