from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from koopcli.koopman.predictor.modes import Modes, exponentials, newton_couplings

RATES = np.array([0.0, -1 + 5j, -1 - 5j, -0.5, -3 + 2j, -3 - 2j])


@pytest.fixture(params=["diagonal", "newton"])
def modes(request):
    couplings = np.zeros(5) if request.param == "diagonal" else newton_couplings(RATES, 1.5)
    return Modes(RATES, couplings, copies=4, dt=0.01)


def dense(modes):
    return np.kron(np.eye(modes.copies), expm(modes.generator * modes.dt))


def test_it_multiplies_like_its_matrix(modes):
    rows = np.random.default_rng(0).standard_normal((5, 3, 24))
    assert len(modes) == 24
    assert rows @ modes == pytest.approx(rows @ dense(modes), rel=1e-13, abs=1e-13)
    assert modes @ rows[0].T == pytest.approx(dense(modes) @ rows[0].T, rel=1e-13, abs=1e-13)
    assert modes @ rows[0, 0] == pytest.approx(dense(modes) @ rows[0, 0], rel=1e-13, abs=1e-13)


def test_its_eigenvalues_are_those_of_the_rates(modes):
    found = np.linalg.eigvals(dense(modes)[:6, :6])
    assert np.sort_complex(found) == pytest.approx(np.sort_complex(modes.eigenvalues), rel=1e-12)
    assert modes.eigenvalues == pytest.approx(np.exp(RATES * 0.01))


def test_its_powers(modes):
    powers = modes.powers(7)
    assert powers[0] == pytest.approx(np.eye(6))
    assert powers[7] == pytest.approx(expm(7 * 0.01 * modes.generator), rel=1e-12, abs=1e-14)


def test_without_couplings_every_pair_is_an_eigenfunction():
    modes = Modes(RATES, np.zeros(5), 1, 0.01)
    start = np.random.default_rng(1).standard_normal(6)
    after = modes.powers(30)[30] @ start
    for first in (1, 4):
        then = (start[first] + 1j * start[first + 1]) * np.exp(RATES[first] * 0.3)
        assert after[first] + 1j * after[first + 1] == pytest.approx(then, rel=1e-12)
    assert after[[0, 3]] == pytest.approx(start[[0, 3]] * np.exp(RATES[[0, 3]].real * 0.3), rel=1e-12)


def test_newtons_form_spans_the_exponentials():
    """Driving the first state, or reading the last one, gives every e^{λt} and nothing else."""
    modes = Modes(RATES, newton_couplings(RATES, 1.5), 1, 0.01)
    V = exponentials(RATES, 0.01 * np.arange(151.0))
    powers = modes.powers(150)
    for basis in (powers[:, :, 0], powers[:, -1, :]):
        assert np.linalg.matrix_rank(basis) == 6
        for one, other in ((basis, V), (V, basis)):
            fitted = one @ np.linalg.lstsq(one, other, rcond=None)[0]
            assert fitted == pytest.approx(other, abs=1e-10 * np.abs(other).max())


def test_newtons_form_is_far_better_conditioned():
    rates = np.array([0, -0.5, -0.6, -0.7, -1.0, -1.1, -1.2, -1.3, -1.4, -1.5], dtype=complex)
    V = exponentials(rates, 0.01 * np.arange(151.0))
    newton = Modes(rates, newton_couplings(rates, 1.5), 1, 0.01).powers(150)[:, :, 0]

    def condition(columns):
        return np.linalg.cond(columns / np.linalg.norm(columns, axis=0))

    assert condition(V) > 1e11
    assert condition(newton) < 1e8


def test_a_rate_that_comes_twice_is_no_obstacle():
    """Newton's form of a double rate holds t e^{λt}, as it should."""
    modes = Modes(np.array([-1.0, -1.0], dtype=complex), np.array([1.0]), 1, 0.01)
    t = 0.01 * np.arange(51)
    assert modes.powers(50)[:, 1, 0] == pytest.approx(t * np.exp(-t), rel=1e-12)


def test_exponentials_in_real_form():
    V = exponentials(RATES, np.array([0.0, 0.3]))
    assert V[0].tolist() == [1, 1, 0, 1, 1, 0]
    e = np.exp(-0.3)
    assert V[1, 1:3] == pytest.approx([e * np.cos(1.5), e * np.sin(1.5)])
