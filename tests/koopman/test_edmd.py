from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from koopcli.errors import InvalidValueError
from koopcli.koopman import edmd
from koopcli.koopman.evaluation import evaluate
from koopcli.records import Array, Channels, Packed, Trajectories
from tests.conftest import box_sample, grid_sample, trajectories_of

REFERENCE = json.loads((Path(__file__).parents[1] / "golden" / "edmd_reference.json").read_text())
ORDERS = range(3, 9)


@dataclass(frozen=True)
class Monomials:
    """A basis given by exponents, for systems whose Koopman operator is known."""

    exponents: tuple[tuple[int, ...], ...]

    @property
    def functions(self):
        return len(self.exponents)

    @property
    def constant(self):
        ones = (0,) * len(self.exponents[0])
        return self.exponents.index(ones) if ones in self.exponents else None

    @property
    def state_map(self):
        n_x = len(self.exponents[0])
        return np.array([[float(e == tuple(np.eye(n_x, dtype=int)[i])) for e in self.exponents] for i in range(n_x)])

    def lift(self, x):
        return np.stack([np.prod(x ** np.array(e), axis=1) for e in self.exponents], axis=1)

    def observe(self, x, rows):
        return self.lift(x) @ rows.T

    def onto(self, rows):
        return lambda x: self.observe(x, rows)

    def group_moments(self, x, weights):
        z = self.lift(x.reshape(-1, x.shape[-1])).reshape(*x.shape[:2], -1)
        return np.einsum("jq,sjN->sqN", weights, z)

    def pack(self):
        return Packed({"exponents": Array(np.array(self.exponents), ("function", "state"), "1")}, {"kind": "monomials"})


def channels(prefix, n):
    return Channels(tuple(f"{prefix}{i}" for i in range(n)), ("1",) * n)


def synthetic(step, x0, u, product=None) -> Trajectories:
    """Trajectories of the map ``step(x, u)``."""
    x = [x0]
    for k in range(u.shape[1]):
        x.append(step(x[-1], u[:, k]))
    return Trajectories(np.stack(x, axis=1), u, 1.0, channels("x", x0.shape[1]), channels("u", u.shape[2]), product)


@pytest.mark.parametrize("product", [True, False])
def test_a_linear_system_is_recovered_exactly(product):
    rng = np.random.default_rng(8)
    A, B = rng.standard_normal((3, 3)) / 3, rng.standard_normal((3, 2))
    states, columns = rng.standard_normal((40, 3)), rng.standard_normal((7, 2))
    x0, u = np.repeat(states, 7, axis=0), np.tile(columns[:, None], (40, 1, 1))
    data = synthetic(lambda x, u: x @ A.T + u @ B.T, x0, u, (40, 7) if product else None)
    basis = Monomials(((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)))
    predictor = edmd.fit(data, basis)
    assert predictor.A[1:, 1:] == pytest.approx(A, abs=1e-12)
    assert predictor.A[1:, 0] == pytest.approx(np.zeros(3), abs=1e-12)
    assert predictor.B[1:] == pytest.approx(B, abs=1e-12)
    assert predictor.B[0] == pytest.approx([0, 0], abs=1e-12)
    assert predictor.rank == 6


def test_the_slow_manifold_gives_its_three_eigenvalues():
    a, b, c = 0.9, 0.5, 0.7
    rng = np.random.default_rng(9)

    def step(x, u):
        return np.stack([a * x[:, 0], b * x[:, 1] + c * x[:, 0] ** 2], axis=1) + 0 * u

    data = synthetic(step, rng.uniform(-1, 1, (50, 2)), np.zeros((50, 6, 1)))
    predictor = edmd.fit(data, Monomials(((1, 0), (0, 1), (2, 0))))
    assert np.sort(np.linalg.eigvals(predictor.A)) == pytest.approx(np.sort([a, b, a**2]), abs=1e-12)
    assert predictor.rank == 3  # the input never moved: its direction is dropped and not invented
    assert not predictor.B.any()
    x_hat = predictor.predict(np.array([0.8, -0.3]), steps=20)
    truth = synthetic(step, np.array([[0.8, -0.3]]), np.zeros((1, 20, 1))).x[0]
    assert x_hat == pytest.approx(truth, abs=1e-12)


def test_no_pair_spans_two_trajectories():
    rng = np.random.default_rng(10)
    data = synthetic(lambda x, u: 0.5 * x + u, rng.standard_normal((30, 1)), rng.standard_normal((30, 4, 1)))
    pairs = list(data.transitions(8))
    assert sum(len(x) for x, _, _ in pairs) == 120
    for x, u, x_next in pairs:
        assert x_next == pytest.approx(0.5 * x + u, abs=1e-14)


@pytest.fixture(scope="module")
def reduced(plant):
    return trajectories_of(plant, grid_sample(count=9, columns=6), 1)


@pytest.mark.parametrize("order", [2, 5])
def test_blocks_and_product_agree(reduced, order):
    basis = edmd.basis_from_data(reduced, "tensor", order)
    product = edmd.fit(reduced, basis)
    general = replace(reduced, product=None)
    other = edmd.basis_from_data(general, "tensor", order)
    blocks = edmd.fit(general, other)
    for name in "AB":
        one, two = getattr(product, name), getattr(blocks, name)
        assert np.abs(one - two).max() <= 1e-9 * np.abs(one).max()
    assert (blocks.C == product.C).all()
    assert blocks.rank == product.rank == basis.functions + 4
    assert blocks.condition == pytest.approx(product.condition, rel=0.1)
    assert (blocks.coverage.domain == product.coverage.domain).all()


def test_the_size_of_a_block_does_not_matter(reduced, monkeypatch):
    general = replace(reduced, product=None)
    basis = edmd.basis_from_data(general, "tensor", 3)
    large = edmd.fit(general, basis)
    monkeypatch.setattr(edmd, "BLOCK", 100)
    small = edmd.fit(general, basis)
    assert pytest.approx(large.A, rel=1e-10, abs=1e-12) == small.A
    assert pytest.approx(large.A, rel=1e-9, abs=1e-12) == edmd.fit(reduced, basis).A


def test_a_raw_monomial_fit_predicts_the_same(plant):
    """At order 4 the normal equations on raw monomials still hold, and EDMD does not depend on the basis chosen."""
    data = trajectories_of(plant, grid_sample(), 1)
    predictor = edmd.fit(data, edmd.basis_from_data(data, "tensor", 4))
    raw = Monomials(tuple((a, b, c) for a in range(5) for b in range(5) for c in range(5)))
    gram, cross = np.zeros((129, 129)), np.zeros((129, 125))
    for x, u, x_next in data.transitions(4096):
        V = np.hstack([raw.lift(x), u])
        gram += V.T @ V
        cross += V.T @ raw.lift(x_next)
    L = np.linalg.cholesky(gram)
    W = np.linalg.solve(L.T, np.linalg.solve(L, cross))
    A, B = W[:125].T, W[125:].T
    test = trajectories_of(plant, box_sample(200), 30)
    z = raw.lift(test.x[:, 0])
    expected = [test.x[:, 0]]
    for k in range(30):
        z = z @ A.T + test.u[:, k] @ B.T
        expected.append(z @ raw.state_map.T)
    expected = np.stack(expected, axis=1)
    ours = predictor.predict(test.x[:, 0], test.u)
    assert np.abs(ours - expected).max() <= 1e-6 * np.abs(expected).max()


@pytest.mark.parametrize(
    "columns",
    [
        np.full((3, 2), 0.1),  # inputs that never move, and whose mean does not round to themselves
        np.array([[1.0, 0.1], [2.0, 0.1], [4.0, 0.1]]),
        np.array([[1.0, 2.0], [2.0, 4.0], [4.0, 8.0]]),
    ],
    ids=["constant", "one constant", "proportional"],
)
def test_inputs_that_determine_too_little_give_one_answer_by_either_path(columns):
    """The direction that no input takes is dropped; product and blocks choose the same solution of least norm."""
    rng = np.random.default_rng(13)
    A, B = rng.standard_normal((3, 3)) / 3, rng.standard_normal((3, 2))
    states = rng.standard_normal((40, 3))
    x0, u = np.repeat(states, 3, axis=0), np.tile(columns[:, None], (40, 1, 1))
    data = synthetic(lambda x, u: x @ A.T + u @ B.T, x0, u, (40, 3))
    basis = Monomials(((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)))
    product, blocks = edmd.fit(data, basis), edmd.fit(replace(data, product=None), basis)
    assert product.rank == blocks.rank == 4 + np.linalg.matrix_rank(columns - columns.mean(axis=0), tol=1e-9)
    assert pytest.approx(blocks.A, abs=1e-9) == product.A
    assert pytest.approx(blocks.B, abs=1e-9) == product.B
    assert product.predict(x0[:5], u[:5]) == pytest.approx(data.x[:5], abs=1e-9)
    moving = np.ptp(columns, axis=0) > 0  # what never moves is no direction; what moves with another is one too many
    assert product.directions == blocks.directions == 4 + moving.sum()
    assert (product.condition > 1e10) == (product.rank < product.directions)


def test_a_basis_from_many_rows_uses_a_spread_choice(monkeypatch, reduced):
    """Regular data must not be subsampled in step with their own period."""
    general = replace(reduced, product=None)
    monkeypatch.setattr(edmd, "MARGINAL_ROWS", 2000)
    basis = edmd.basis_from_data(general, "tensor", 8)  # all nine values of each state are found
    assert basis.functions == 9**3
    monkeypatch.setattr(edmd, "MARGINAL_ROWS", 10)
    assert edmd.basis_from_data(reduced, "tensor", 8).functions == 9**3


def test_long_trajectories_are_read_in_pieces(reduced):
    rng = np.random.default_rng(14)
    data = synthetic(lambda x, u: 0.9 * x + u, rng.standard_normal((2, 1)), rng.standard_normal((2, 1000, 1)))
    sizes = [len(x) for x, _, _ in data.transitions(64)]
    assert max(sizes) == 64
    assert sum(sizes) == 2000


def test_a_false_product_is_found_out(reduced):
    x = np.array(reduced.x)
    x[3, 0, 0] += 1.0
    with pytest.raises(InvalidValueError, match="are marked as a product"):
        edmd.fit(replace(reduced, x=x), edmd.basis_from_data(reduced, "tensor", 2))
    with pytest.raises(InvalidValueError, match="are not a product of"):
        replace(reduced, product=(7, 7))


def test_too_few_samples_are_refused(reduced):
    basis = edmd.basis_from_data(reduced, "tensor", 5)
    few = replace(reduced, x=reduced.x[:100], u=reduced.u[:100], product=None)
    with pytest.raises(InvalidValueError, match="100 samples cannot determine 216 functions and 4 inputs"):
        edmd.fit(few, basis)


@pytest.fixture(scope="module")
def tests(plant):
    return {e: trajectories_of(plant, box_sample(excitation=e), 30) for e in ("none", "fresh", "held")}


@pytest.mark.parametrize("draw", ["random", "even"])
def test_the_reference_table_at_full_size(plant, tests, draw):
    """Means and medians within 1 % (or half the last printed digit) and the yaw rate to rounding, orders 3 to 8."""
    data = trajectories_of(plant, grid_sample(draw=draw), 1)
    assert len(data) == 202_500
    for order in ORDERS:
        predictor = edmd.fit(data, edmd.basis_from_data(data, "tensor", order))
        assert predictor.condition < 3
        for excitation, test in tests.items():
            figures = evaluate(predictor, test, slice(None), 1).figures()
            for statistic, printed in zip(("mean", "median"), REFERENCE[draw][str(order)][excitation], strict=True):
                half_digit = 0.5 * 10.0 ** -len(printed.partition(".")[2])
                assert figures["rmse"][statistic] == pytest.approx(float(printed), rel=0.01, abs=half_digit)
            limit = 1e-9 if draw == "even" else (1e-6 if order <= 7 else np.inf)
            assert figures["max_error"]["yaw_rate"] <= limit


@pytest.mark.parametrize("seed", [1, 2])
def test_yaw_rate_on_other_random_draws(plant, tests, seed):
    """Rounding grows with the order and with how far the draw leaves the edges open; seed 2 is the worst of five."""
    data = trajectories_of(plant, grid_sample(seed=seed), 1)
    predictor = edmd.fit(data, edmd.basis_from_data(data, "tensor", 7))
    for test in tests.values():
        assert evaluate(predictor, test, slice(None), 1).figures()["max_error"]["yaw_rate"] <= 1e-6


def test_yaw_rate_on_even_points_to_order_ten(plant, tests):
    data = trajectories_of(plant, grid_sample(draw="even"), 1)
    predictor = edmd.fit(data, edmd.basis_from_data(data, "tensor", 10))
    assert evaluate(predictor, tests["fresh"], slice(0, 1000), 1).figures()["max_error"]["yaw_rate"] <= 1e-9
