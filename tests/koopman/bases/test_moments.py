from __future__ import annotations

import numpy as np
import pytest

from koopcli.koopman.bases.moments import products_of
from koopcli.koopman.bases.orthonormal import orthonormal_polynomials
from koopcli.koopman.bases.polynomial import Anisotropic, Tensor, Total


def axis_on(nodes, degree):
    return orthonormal_polynomials(nodes, np.full(len(nodes), 1 / len(nodes)), degree)


@pytest.mark.parametrize("degree", [0, 1, 4, 7, 10])
def test_a_product_of_two_polynomials_is_its_sum_of_others(degree):
    nodes = np.sort(np.random.default_rng(degree).uniform(-3, 8, 40))
    axis = axis_on(nodes, degree)
    products = products_of([axis])
    t = np.random.default_rng(1).uniform(-3, 8, 50)
    p, wide = axis(t), products.factors[0](t)
    assert products.linear[0].shape == (degree + 1, degree + 1, 2 * degree + 1)
    found = np.einsum("adm,mn->adn", products.linear[0], wide)
    assert found == pytest.approx(p[:, np.newaxis] * p, abs=1e-12 * np.abs(p).max() ** 2)


CLOUDS = {
    "uniform": lambda rng: rng.uniform(-1, 1, 5000),
    "bell": lambda rng: rng.standard_normal(5000),
    "arcs": lambda rng: np.cos(rng.uniform(0, np.pi, 5000)),
    "few": lambda rng: np.repeat(np.sort(rng.uniform(-1, 1, 15)), 300),
    "one-sided": lambda rng: rng.exponential(1.0, 5000),
}


@pytest.mark.parametrize("cloud", CLOUDS)
def test_little_cancels_wherever_samples_crowd(cloud):
    """The parts of a product are no larger than a few times the product: so moments keep the digits."""
    t = CLOUDS[cloud](np.random.default_rng(4))
    distinct, counts = np.unique(t, return_counts=True)
    axis = orthonormal_polynomials(distinct, counts / len(t), 7)
    products = products_of([axis])
    assert np.abs(products.linear[0]).sum(axis=2).max() < 100
    (found,) = products.gram(products.sums(t[:, np.newaxis], np.ones((1, len(t)))))
    assert found / len(t) == pytest.approx(np.eye(8), abs=1e-12)


@pytest.mark.parametrize(("states", "order"), [(1, 6), (2, 4), (3, 3)])
def test_the_gram_matrix_by_moments_is_the_one_entry_by_entry(states, order):
    rng = np.random.default_rng(2)
    x = rng.uniform(-1, 1, (500, states)) * [30, 20, 5][:states]
    basis = Tensor(order).make(x)
    weights = rng.standard_normal((3, 500))
    z = basis.lift(x)
    direct = np.einsum("qn,ni,nj->qij", weights, z, z)
    found = basis.products.gram(basis.products.sums(x, weights))
    assert found == pytest.approx(direct, abs=1e-12 * np.abs(z).max() ** 2 * len(x))


def test_only_whole_tensors_of_orthonormal_factors_have_them():
    x = np.random.default_rng(3).uniform(-1, 1, (100, 3))
    assert Tensor(2).make(x).products is not None
    assert Total(2).make(x).products is None
    assert Anisotropic(3, 2).make(x).products is None
    assert Tensor(2).make(x, raw=True).products is None
