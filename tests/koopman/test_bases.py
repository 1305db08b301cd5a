from __future__ import annotations

import numpy as np
import pytest

from koopcli.koopman.bases import BASES
from tests.conftest import grid_sample


@pytest.fixture
def nodes():
    return [(factor, np.full(len(factor), 1 / len(factor))) for factor in grid_sample(9).factors]


@pytest.fixture
def x() -> np.ndarray:
    return np.random.default_rng(4).uniform(-1, 1, (40, 3)) * [30, 30, 10]


@pytest.fixture(params=BASES)
def kind(request):
    return BASES[request.param]


def test_shape_count_and_constant(kind, nodes, x):
    basis = kind.make(nodes, 3)
    z = basis.lift(x)
    assert z.shape == (40, basis.functions)
    assert basis.functions == kind.count(3, 3)
    assert basis.constant is None or (z[:, basis.constant] == 1).all()


def test_the_states_are_in_the_basis(kind, nodes, x):
    basis = kind.make(nodes, 3)
    assert basis.lift(x) @ basis.state_map.T == pytest.approx(x, rel=1e-12)


def test_the_state_map_is_the_least_squares_output_matrix(kind, nodes):
    basis = kind.make(nodes, 3)
    x = grid_sample(9).x0
    fitted = np.linalg.lstsq(basis.lift(x), x, rcond=None)[0].T
    assert fitted == pytest.approx(basis.state_map, abs=1e-10)


def test_group_moments_are_the_weighted_sums_of_the_lift(kind, nodes, x):
    basis = kind.make(nodes, 3)
    groups, weights = x.reshape(8, 5, 3), np.random.default_rng(5).standard_normal((5, 2))
    plain = np.einsum("jq,sjN->sqN", weights, basis.lift(x).reshape(8, 5, -1))
    assert basis.group_moments(groups, weights) == pytest.approx(plain, rel=1e-12, abs=1e-12)


def test_packed_and_unpacked_it_lifts_the_same(kind, nodes, x):
    basis = kind.make(nodes, 4)
    assert (kind.unpack(basis.pack()).lift(x) == basis.lift(x)).all()


def test_tensor_is_orthonormal_on_its_grid(nodes):
    basis = BASES["tensor"].make(nodes, 5)
    z = basis.lift(grid_sample(9).x0)
    assert z.T @ z / len(z) == pytest.approx(np.eye(216), abs=1e-10)


def test_tensor_spans_the_monomials(nodes, x):
    basis = BASES["tensor"].make(nodes, 2)
    monomials = np.stack(
        [x[:, 0] ** a * x[:, 1] ** b * x[:, 2] ** c for a in range(3) for b in range(3) for c in range(3)]
    )
    z = basis.lift(x)
    _, residual, rank, _ = np.linalg.lstsq(z, monomials.T / np.abs(monomials).max(axis=1), rcond=None)
    assert rank == 27
    assert (residual < 1e-20).all()
