"""Programmes, and the check of what a solver says of them."""

import sys

import numpy as np
import pytest

from koopcli.control import qp
from koopcli.errors import InvalidValueError
from tests.control.conftest import solver

H, F = np.array([[2.0, 0.5], [0.5, 1.0]]), np.array([-4.0, -1.0])
ROWS, UPPER = np.array([[1.0, 0.0], [0.0, 1.0]]), np.array([1.0, 10.0])
POINT, MULTIPLIERS = np.array([1.0, 0.5]), np.array([1.75, 0.0])  # by hand: the first row is active


def residual(point=POINT, multipliers=MULTIPLIERS, lower=None):
    return qp.kkt_residual(H, F, ROWS, UPPER, lower, point, multipliers)


def test_an_optimum_has_no_residual():
    assert residual() < 1e-15


def test_a_multiplier_of_the_wrong_sign_is_found():
    """The other way round the gradient is zero too, at a point that pulls away from its bound."""
    turned = qp.kkt_residual(-H, -F, ROWS, UPPER, None, POINT, -MULTIPLIERS)
    assert turned == pytest.approx(1.75 / 4)
    below = qp.kkt_residual(-H, -F, ROWS, UPPER, np.full(2, -10.0), POINT, -MULTIPLIERS)
    assert below > 1


@pytest.mark.parametrize(
    ("point", "multipliers"),
    [
        ([1.1, 0.5], [1.75, 0.0]),  # beyond its bound
        ([1.0, 0.4], [1.75, 0.0]),  # the gradient is not zero
        ([0.9, 0.5], [1.75, 0.0]),  # a multiplier off its bound
        ([np.nan, 0.5], [1.75, 0.0]),
    ],
)
def test_what_is_no_optimum_is_found(point, multipliers):
    assert residual(np.array(point), np.array(multipliers)) > 1e-2


def test_the_residual_is_a_share_of_the_slope():
    large = qp.kkt_residual(H, 1e6 * F, ROWS, UPPER, None, POINT, MULTIPLIERS)
    assert large == pytest.approx(1, abs=1e-3)


@solver
def test_simple_bounds_come_before_rows():
    found = qp.solve(H, F, np.array([[1.0, 1.0]]), np.array([1.0, 1.0, 1.2]), np.array([-1.0, -1.0, -9.0]))
    assert found.accepted
    assert found.kkt < 1e-9
    assert found.point == pytest.approx([1.0, 0.2])


@solver
def test_random_programmes_are_solved_and_checked():
    g = np.random.default_rng(0)
    for _ in range(20):
        L = g.normal(size=(8, 8))
        rows = g.normal(size=(20, 8))
        found = qp.solve(L @ L.T + 0.1 * np.eye(8), 10 * g.normal(size=8), rows, g.uniform(0.1, 1, 20))
        assert found.accepted


@solver
def test_a_programme_without_a_solution_is_not_accepted():
    found = qp.solve(H, F, np.array([[1.0, 0.0], [-1.0, 0.0]]), np.array([-1.0, -1.0]))
    assert not found.accepted


@solver
def test_a_programme_that_is_not_finite_is_not_even_tried():
    assert not qp.solve(H, np.array([np.nan, 0.0]), ROWS, UPPER).accepted


@solver
def test_a_solver_that_says_solved_is_not_believed(monkeypatch):
    class Lying:
        @staticmethod
        def solve(*_):
            return np.array([2.0, 0.0]), 0.0, 1, {"lam": np.zeros(2)}

    monkeypatch.setattr(qp, "daqp", lambda: Lying)
    assert not qp.solve(H, F, ROWS, UPPER).accepted


def test_without_the_solver_one_line_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "daqp", None)
    with pytest.raises(InvalidValueError, match=r"pip install 'koopcli\[control\]'"):
        qp.solve(H, F, ROWS, UPPER)
