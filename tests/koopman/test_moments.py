from __future__ import annotations

import numpy as np
import pytest

from koopcli.koopman.moments import _legendre, products_of
from koopcli.koopman.orthonormal import OrthonormalPolynomials, orthonormal_polynomials
from koopcli.koopman.polynomial import polynomial


def axis_on(nodes, degree):
    return orthonormal_polynomials(nodes, np.full(len(nodes), 1 / len(nodes)), degree)


@pytest.mark.parametrize("degree", [0, 1, 4, 7, 10])
def test_a_product_of_two_polynomials_is_its_sum_of_legendre_polynomials(degree):
    nodes = np.sort(np.random.default_rng(degree).uniform(-3, 8, 40))
    axis = axis_on(nodes, degree)
    products = products_of([axis])
    t = np.random.default_rng(1).uniform(-3, 8, 50)
    p, tall = axis(t), products.legendre[0](t)
    assert products.linear[0].shape == (degree + 1, degree + 1, 2 * degree + 1)
    found = np.einsum("adm,mn->adn", products.linear[0], tall)
    assert found == pytest.approx(p[:, np.newaxis] * p, abs=1e-12 * np.abs(p).max() ** 2)


def test_products_of_legendre_polynomials_are_positive_sums():
    """Which is why nothing cancels where samples fill their box."""
    axis = _legendre(OrthonormalPolynomials(0.0, 1.0, np.zeros(0), np.ones(1)), 7)
    linear = products_of([axis]).linear[0]
    assert linear.min() >= -1e-14
    assert np.einsum("adm,m->ad", linear, axis_at_one(14)) == pytest.approx(
        np.outer(axis_at_one(7), axis_at_one(7)), rel=1e-13
    )


def axis_at_one(degree):
    return np.sqrt(2 * np.arange(degree + 1) + 1)


@pytest.mark.parametrize(("states", "order"), [(1, 6), (2, 4), (3, 3)])
def test_the_gram_matrix_by_moments_is_the_one_entry_by_entry(states, order):
    rng = np.random.default_rng(2)
    x = rng.uniform(-1, 1, (500, states)) * [30, 20, 5][:states]
    basis = polynomial(x, "tensor", order, 1)
    weights = rng.standard_normal((3, 500))
    z = basis.lift(x)
    direct = np.einsum("qn,ni,nj->qij", weights, z, z)
    found = basis.products.gram(basis.products.sums(x, weights))
    assert found == pytest.approx(direct, abs=1e-12 * np.abs(z).max() ** 2 * len(x))


def test_only_whole_tensors_of_orthonormal_factors_have_them():
    x = np.random.default_rng(3).uniform(-1, 1, (100, 3))
    assert polynomial(x, "tensor", 2, 1).products is not None
    assert polynomial(x, "total", 2, 1).products is None
    assert polynomial(x, "anisotropic", 3, 2).products is None
    assert polynomial(x, "tensor", 2, 1, raw=True).products is None
