from __future__ import annotations

import numpy as np
import pytest

from koopcli.errors import InvalidValueError
from koopcli.koopman.bases import STORED
from koopcli.koopman.bases.basis import BasisChoice
from koopcli.koopman.bases.polynomial import Anisotropic, Tensor, Total
from koopcli.koopman.bases.states import StatesAlone
from koopcli.koopman.bases.thin_plate import Splines, thin_plate
from tests.conftest import grid_sample

CHOICES = {
    **{kind: cls() for kind, cls in BasisChoice.kinds().items()},
    "tensor": Tensor(3),
    "total": Total(4),
    "anisotropic": Anisotropic(5, degree_velocity=2),
    "anisotropic of the yaw rate": Anisotropic(1, degree_velocity=3),
    "raw": Total(3),
    "thin-plate": Splines(centres=20),
    "thin-plate drawn": Splines(centres=20, placement="drawn", seed=2),
    "states": StatesAlone(),
}


@pytest.fixture
def grid():
    return grid_sample(9).x0


@pytest.fixture
def x() -> np.ndarray:
    return np.random.default_rng(4).uniform(-1, 1, (40, 3)) * [30, 30, 10]


@pytest.fixture(params=CHOICES)
def choice(request):
    return CHOICES[request.param]


@pytest.fixture
def basis(choice, grid, request):
    return choice.make(grid, raw=request.node.callspec.params["choice"] == "raw")


def test_shape_count_and_constant(choice, basis, x):
    z = basis.lift(x)
    assert z.shape == (40, basis.functions)
    assert basis.functions == choice.functions(3)
    assert basis.constant is None or (z[:, basis.constant] == 1).all()
    assert basis.lift(x[:0]).shape == (0, basis.functions)


def test_the_states_are_in_the_basis(basis, x):
    assert basis.lift(x) @ basis.state_map.T == pytest.approx(x, rel=1e-12)


def test_the_state_map_is_the_least_squares_output_matrix(choice, basis, grid):
    fitted = np.linalg.lstsq(basis.lift(grid), grid, rcond=None)[0].T
    assert fitted == pytest.approx(basis.state_map, abs=1e-7)


def test_group_moments_are_the_weighted_sums_of_the_lift(basis, x):
    groups, weights = x.reshape(8, 5, 3), np.random.default_rng(5).standard_normal((5, 2))
    plain = np.einsum("jq,sjN->sqN", weights, basis.lift(x).reshape(8, 5, -1))
    assert basis.group_moments(groups, weights) == pytest.approx(plain, rel=1e-12, abs=1e-12)


def test_packed_and_unpacked_it_lifts_the_same(basis, x):
    packed = basis.pack()
    assert (STORED[packed.meta["kind"]](packed).lift(x) == basis.lift(x)).all()


@pytest.mark.parametrize(
    "choice",
    [family(order) for family in (Tensor, Total) for order in (1, 3, 2)]
    + [Anisotropic(order, degree) for order, degree in ((1, 1), (3, 2), (2, 5))],
)
def test_a_family_is_downward_closed(choice, grid):
    """Every divisor of a product is in the basis, so that the span does not depend on the origin."""
    degrees = choice.make(grid).degrees
    there = {tuple(row) for row in degrees.tolist()}
    assert len(there) == len(degrees)
    assert degrees[0].tolist() == [0, 0, 0]
    for row in there:
        for i in range(3):
            assert row[i] == 0 or tuple(d - (j == i) for j, d in enumerate(row)) in there


def test_families_by_hand(grid):
    total = Total(2).make(grid).degrees
    assert sorted(map(tuple, total.tolist())) == sorted(
        (a, b, c) for a in range(3) for b in range(3) for c in range(3) if a + b + c <= 2
    )
    few = Anisotropic(8, degree_velocity=1).make(grid).degrees
    assert sorted(map(tuple, few.tolist())) == sorted((a, b, c) for a, b in ((0, 0), (0, 1), (1, 0)) for c in range(9))


def test_a_subset_is_the_tensor_basis_without_the_others(grid, x):
    tensor, total = (family(4).make(grid) for family in (Tensor, Total))
    chosen = [tensor.degrees.tolist().index(row) for row in total.degrees.tolist()]
    assert (tensor.lift(x)[:, chosen] == total.lift(x)).all()


def test_the_laplacian_of_a_spline_twice():
    """In three dimensions Δ(r² log r) = 6 log r + 5, and Δ of that 6 / r²."""
    h, at = 1e-2, np.array([0.7, -0.4, 0.5])
    steps = h * np.concatenate([np.zeros((1, 3)), np.eye(3), -np.eye(3)])
    weight = np.array([-6.0, 1, 1, 1, 1, 1, 1]) / h**2

    def laplacian(points, function):
        around = (points[:, None] + steps).reshape(-1, 3)
        return function(around).reshape(len(points), 7) @ weight

    twice = laplacian(at[None], lambda p: laplacian(p, lambda q: thin_plate(q, np.zeros((1, 3)), np.ones(3))[:, 0]))
    assert twice == pytest.approx(6 / (at @ at), rel=1e-3)


def test_means_of_clusters_lie_in_the_data_and_more_than_there_are_states_are_refused(grid):
    centres = Splines(centres=100).make(grid).centres
    assert (centres >= grid.min(axis=0)).all()
    assert (centres <= grid.max(axis=0)).all()
    assert len(np.unique(centres, axis=0)) == 100
    with pytest.raises(InvalidValueError, match="10 centres cannot be the means of 5 different states"):
        Splines(centres=10).make(np.repeat(grid[:5], 4, axis=0))


def test_tensor_is_orthonormal_on_its_grid(grid):
    z = Tensor(5).make(grid).lift(grid)
    assert z.T @ z / len(z) == pytest.approx(np.eye(216), abs=1e-10)


def test_tensor_spans_the_monomials(grid, x):
    basis = Tensor(2).make(grid)
    monomials = np.stack(
        [x[:, 0] ** a * x[:, 1] ** b * x[:, 2] ** c for a in range(3) for b in range(3) for c in range(3)]
    )
    z = basis.lift(x)
    _, residual, rank, _ = np.linalg.lstsq(z, monomials.T / np.abs(monomials).max(axis=1), rcond=None)
    assert rank == 27
    assert (residual < 1e-20).all()
