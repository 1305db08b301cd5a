from __future__ import annotations

import numpy as np
import pytest

from koopcli.errors import InvalidValueError
from koopcli.koopman.edmd import regression
from koopcli.koopman.edmd.regression import least_squares


def blocks(V, Y, size):
    return lambda: ((V[i : i + size], Y[i : i + size]) for i in range(0, len(V), size))


@pytest.fixture
def data():
    rng = np.random.default_rng(6)
    return rng.standard_normal((300, 12)), rng.standard_normal((300, 5))


@pytest.mark.parametrize("limit", [1e6, 0.5], ids=["gram", "qr"])
@pytest.mark.parametrize("size", [1, 17, 300])
def test_equals_lstsq_by_either_path_in_blocks_of_any_size(data, size, limit, monkeypatch):
    monkeypatch.setattr(regression, "GRAM_CONDITION", limit)
    V, Y = data
    solution = least_squares(blocks(V, Y, size))
    assert solution.coefficients == pytest.approx(np.linalg.lstsq(V, Y, rcond=None)[0], rel=1e-10, abs=1e-12)
    assert solution.rank == 12
    assert solution.condition == pytest.approx(np.linalg.cond(V / np.linalg.norm(V, axis=0)), rel=1e-6)


def test_units_of_the_columns_do_not_matter(data):
    V, Y = data
    scale = 10.0 ** np.arange(-6, 6)
    plain, scaled = least_squares(blocks(V, Y, 50)), least_squares(blocks(V * scale, Y, 50))
    assert scaled.coefficients * scale[:, None] == pytest.approx(plain.coefficients, rel=1e-10, abs=1e-12)
    assert scaled.condition == pytest.approx(plain.condition, rel=1e-10)


def test_ill_conditioned_columns_keep_their_digits(data):
    """Normal equations would lose all digits at a condition of 1e9; the blocked QR keeps half of them."""
    V = data[0].copy()
    V[:, 1] = V[:, 0] + 1e-9 * V[:, 1]
    truth = np.arange(60.0).reshape(12, 5)
    solution = least_squares(blocks(V, V @ truth, 40))
    assert solution.rank == 12
    assert solution.condition > 1e8
    assert V @ solution.coefficients == pytest.approx(V @ truth, rel=1e-12)
    assert solution.coefficients == pytest.approx(truth, rel=1e-4, abs=1e-4)


def test_a_dependent_column_is_dropped_and_counted(data):
    V, Y = data
    V = np.column_stack([V, V[:, 0] + V[:, 1], np.zeros(len(V))])
    solution = least_squares(blocks(V, Y, 64))
    assert solution.rank == 12
    assert solution.condition > 1e14
    best = np.linalg.lstsq(V, Y, rcond=1e-10)[0]
    assert V @ solution.coefficients == pytest.approx(V @ best, rel=1e-9, abs=1e-11)


def test_nothing_and_nan_are_refused(data):
    V, Y = data
    with pytest.raises(InvalidValueError, match="no samples"):
        least_squares(lambda: iter(()))
    with pytest.raises(InvalidValueError, match="not finite"):
        least_squares(lambda: [(V * np.nan, Y)])


@pytest.mark.parametrize("limit", [1e6, 0.5], ids=["gram", "qr"])
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_target_that_is_not_finite_is_refused(data, limit, bad, monkeypatch):
    """As of a trajectory that blows up in its last sample, which no column holds."""
    monkeypatch.setattr(regression, "GRAM_CONDITION", limit)
    V, Y = data[0], data[1].copy()
    Y[-1, 2] = bad
    with pytest.raises(InvalidValueError, match="not finite"):
        least_squares(blocks(V, Y, 50))
