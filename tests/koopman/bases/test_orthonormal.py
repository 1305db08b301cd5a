from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from koopcli.errors import InvalidValueError
from koopcli.koopman.bases.orthonormal import orthonormal_polynomials


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 10_000), st.integers(2, 15), st.floats(1e-3, 1e3), st.floats(-1e3, 1e3))
def test_orthonormal_on_the_nodes_wherever_they_lie(seed, degree, width, shift):
    rng = np.random.default_rng(seed)
    nodes = shift + width * np.sort(rng.uniform(-1, 1, 40))
    weights = rng.uniform(0.5, 2, 40)
    p = orthonormal_polynomials(nodes, weights, degree)(nodes)
    gram = (p * weights / weights.sum()) @ p.T
    assert gram == pytest.approx(np.eye(degree + 1), abs=1e-6)


@pytest.mark.parametrize("degree", [7, 10, 14])
def test_orthonormal_to_rounding_on_even_points_up_to_the_highest_degree(degree):
    nodes = np.linspace(-30, 30, 15)
    p = orthonormal_polynomials(nodes, np.ones(15), degree)(nodes)
    assert p @ p.T / 15 == pytest.approx(np.eye(degree + 1), abs=1e-11)


def test_many_nodes_give_the_legendre_polynomials():
    nodes, weights = np.polynomial.legendre.leggauss(64)
    p = orthonormal_polynomials(nodes, weights, 10)(np.linspace(-1, 1, 11))
    scale = nodes.max()  # the polynomials live on the nodes' own span; values do not depend on it
    legendre = np.polynomial.legendre.legvander(np.linspace(-1, 1, 11), 10) * np.sqrt(2 * np.arange(11) + 1)
    assert scale < 1
    assert pytest.approx(legendre, rel=1e-10, abs=1e-10) == p.T


def test_each_polynomial_has_its_degree():
    axis = orthonormal_polynomials(np.linspace(0, 1, 9), np.ones(9), 4)
    t = np.linspace(-2, 3, 50)
    for degree, values in enumerate(axis(t)):
        exact = np.polynomial.Polynomial.fit(t, values, degree)
        assert exact(t) == pytest.approx(values, rel=1e-8, abs=1e-8)
        assert abs(exact.coef[-1]) > 1e-3


def test_too_few_values_are_refused():
    with pytest.raises(InvalidValueError, match="3 distinct values of a state carry polynomials up to order 2"):
        orthonormal_polynomials(np.arange(3.0), np.ones(3), 3)


def test_one_value_carries_the_constant():
    assert orthonormal_polynomials(np.array([2.0]), np.ones(1), 0)(np.array([5.0])).tolist() == [[1.0]]
