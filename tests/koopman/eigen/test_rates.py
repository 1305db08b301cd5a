"""Rates that are not the data's own: the comb, and the search for the best."""

from __future__ import annotations

import numpy as np
import pytest

from koopcli.koopman.eigen.rates.comb import Comb
from koopcli.koopman.eigen.rates.varpro import Varpro, projected_residual, searched
from koopcli.koopman.predictor.modes import exponentials

COMB = Comb(10, 2.0, 26.0, 1.0)


def test_the_comb_as_written_down():
    found = COMB.even
    assert len(found) == 22 == COMB.count(3)
    assert found[:20:2] == pytest.approx(-1 + 1j * np.linspace(2, 26, 10))
    assert found[1:20:2] == pytest.approx(found[:20:2].conj())
    assert found[20:] == pytest.approx([0, -1])


def sums(rates, count=40, steps=60, dt=0.02):
    """Trajectories that are exactly sums of exponentials."""
    V = exponentials(np.asarray(rates), dt * np.arange(steps + 1.0))
    c = np.random.default_rng(0).standard_normal((count, len(rates), 3))
    return [np.einsum("kl,jls->jks", V, c)]


def test_the_gradient_is_that_of_the_residual():
    rates = np.array([-1 + 3j, -1 - 3j, -0.5 + 7j, -0.5 - 7j, 0.2, -2.0])
    x = sums([-1.3 + 4j, -1.3 - 4j, -0.1, -3.0])[0]
    columns = x.transpose(1, 0, 2).reshape(61, -1)
    gram = columns @ columns.T / (columns**2).sum()
    t = 0.02 * np.arange(61.0)
    _, slope = projected_residual(gram, rates, t)

    def at(i, step):
        moved = rates.copy()
        moved[i] += step
        if rates[i].imag > 0:
            moved[i + 1] = moved[i].conj()
        return projected_residual(gram, moved, t)[0]

    for i in (0, 2, 4, 5):
        for step, part in ((1e-5, slope[i].real), (1e-5j, slope[i].imag)):
            if step == 1e-5j and rates[i].imag == 0:
                continue
            numeric = (at(i, step) - at(i, -step)) / 2e-5
            assert part == pytest.approx(numeric, rel=1e-4, abs=1e-10)


def test_the_search_finds_the_rates_of_the_data():
    true = np.array([-0.7 + 5j, -0.7 - 5j, -2 + 12j, -2 - 12j, 0.0, -1.5])
    found = searched(sums(true), 0.02, Varpro(2, 3.0, 15.0, 1.0))
    assert np.sort_complex(found) == pytest.approx(np.sort_complex(true), abs=2e-3)


def test_the_search_is_no_worse_than_where_it_starts():
    rng = np.random.default_rng(1)
    x = [np.cumsum(rng.standard_normal((30, 41, 3)), axis=1)]
    spectrum = Varpro(3, 2.0, 20.0, 1.0)
    columns = x[0].transpose(1, 0, 2).reshape(41, -1)
    gram, t = columns @ columns.T / (columns**2).sum(), 0.01 * np.arange(41.0)
    before = projected_residual(gram, spectrum.even, t)[0]
    after = projected_residual(gram, spectrum.find(x[0], x, 0.01), t)[0]
    assert after < 0.9 * before
