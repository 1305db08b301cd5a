"""Extended dynamic mode decomposition with inputs (docs/equations.md 4)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.koopman.bases import BASES, Basis
from koopcli.koopman.predictor import Predictor
from koopcli.koopman.regression import condition_number, least_squares
from koopcli.progress import Progress, silent
from koopcli.records import FloatArray, Trajectories

BLOCK = 4096  # rows lifted together
MARGINAL_ROWS = 1 << 18  # rows that may shape the basis; the regression always reads all of them


class _Operators(NamedTuple):
    A: FloatArray
    B: FloatArray
    rank: int
    condition: float


def basis_from_data(trajectories: Trajectories, kind: str, order: int) -> Basis:
    """The basis ``kind`` of ``order`` on the distinct values that each state takes in the data, with their shares.

    Of more than ``MARGINAL_ROWS`` samples only every k-th shapes the basis; the fit is over all of them.
    """
    every = -(-len(trajectories) * trajectories.steps // MARGINAL_ROWS)
    x = np.concatenate([x[::every] for x, _, _ in trajectories.transitions(BLOCK)])
    nodes = []
    for column in x.T:
        values, counts = np.unique(column, return_counts=True)
        nodes.append((values, counts / counts.sum()))
    return BASES[kind].make(nodes, order)


def fit(trajectories: Trajectories, basis: Basis, progress: Progress = silent) -> Predictor:
    """A, B of ψ(x⁺) ≈ A ψ(x) + B u by least squares over all one-step pairs (4.4); C is exact.

    On a product dataset of one step ψ(x) takes few distinct values and ψ(x⁺) can be averaged over the inputs first,
    which is the same minimum for a fraction of the work (4.5); any other dataset is read in blocks. Raises
    ``InvalidValueError`` for fewer samples than unknowns and for data that are not finite.
    """
    samples, unknowns = (
        len(trajectories) * trajectories.steps,
        basis.functions + len(trajectories.input_channels),
    )
    if samples < unknowns:
        raise InvalidValueError(
            f"{samples} samples cannot determine {basis.functions} functions and "
            f"{len(trajectories.input_channels)} inputs: lower the order or sample more"
        )
    if trajectories.product is not None and trajectories.steps == 1:
        A, B, rank, condition = _fit_product(trajectories, trajectories.product, basis, progress)
    else:
        A, B, rank, condition = _fit_blocks(trajectories, basis, progress)
    return Predictor(
        basis=basis,
        A=A,
        B=B,
        C=basis.state_map,
        dt=trajectories.dt,
        domain=_domain(trajectories),
        state_channels=trajectories.state_channels,
        input_channels=trajectories.input_channels,
        rank=rank,
        condition=condition,
        spectral_radius=float(np.abs(np.linalg.eigvals(A)).max()),
        plant=trajectories.plant,
    )


def _fit_blocks(trajectories: Trajectories, basis: Basis, progress: Progress) -> _Operators:
    """Least squares on the rows [ψ(x), u], read in blocks."""
    N, total = basis.functions, len(trajectories) * trajectories.steps

    def rows() -> Iterator[tuple[FloatArray, FloatArray]]:
        done = 0
        for x, u, x_next in trajectories.transitions(BLOCK):
            yield np.hstack([basis.lift(x), u]), basis.lift(x_next)
            done += len(x)
            progress(done, total)

    solution = least_squares(rows)
    W = solution.coefficients
    return _Operators(W[:N].T.copy(), W[N:].T.copy(), solution.rank, solution.condition)


def _fit_product(trajectories: Trajectories, product: tuple[int, int], basis: Basis, progress: Progress) -> _Operators:
    """The same minimum from the mean and the slope of ψ(x⁺) over the inputs of each state (4.5).

    The centred inputs are orthogonal to every ψ(x), so A and B separate; B's share of the mean input goes to the
    constant's column of A.
    """
    states, m = product
    columns, x = _factors(trajectories, product)
    u_mean = columns.mean(axis=0)
    centred = columns - u_mean
    spread = np.linalg.norm(centred, axis=0)
    scaled = centred / np.where(spread > 0, spread, 1.0)
    weights = np.column_stack([np.full(m, 1 / m), np.linalg.pinv(scaled).T / np.where(spread > 0, spread, 1.0)])

    mean = np.empty((states, basis.functions))
    slope = np.zeros((columns.shape[1], basis.functions))
    block = max(1, BLOCK // m)
    for start in range(0, states, block):
        stop = min(start + block, states)
        x_next = trajectories.x[start * m : stop * m][:, 1].reshape(stop - start, m, -1)
        moments = basis.group_moments(x_next, weights)
        mean[start:stop] = moments[:, 0]
        slope += moments[:, 1:].sum(axis=0)
        progress(stop, states)

    solution = least_squares(lambda: [(basis.lift(x), mean)])
    B = slope.T / states
    A = solution.coefficients.T.copy()
    A[:, basis.constant] -= B @ u_mean
    singular = np.linalg.svd(scaled, compute_uv=False)
    rank = solution.rank + int(np.linalg.matrix_rank(scaled))
    return _Operators(A, B, rank, condition_number(np.concatenate([solution.singular_values, singular])))


def _factors(trajectories: Trajectories, product: tuple[int, int]) -> tuple[FloatArray, FloatArray]:
    """The input columns (m, n_u) and the states (n, n_x), after checking that the data are their product."""
    states, m = product
    columns: FloatArray = trajectories.u[:m][:, 0]
    x = np.empty((states, len(trajectories.state_channels)))
    block = max(1, BLOCK // m)
    for start in range(0, states, block):
        stop = min(start + block, states)
        rows = slice(start * m, stop * m)
        x0 = trajectories.x[rows][:, 0].reshape(stop - start, m, -1)
        u = trajectories.u[rows][:, 0].reshape(stop - start, m, -1)
        if (x0 != x0[:, :1]).any() or (u != columns).any():
            raise InvalidValueError(
                f"the trajectories are marked as a product of {states} states × {m} inputs but are not: "
                "simulate them again or drop the mark"
            )
        x[start:stop] = x0[:, 0]
    return columns, x


def _domain(trajectories: Trajectories) -> FloatArray:
    """The smallest and the largest training state (2, n_x)."""
    extremes = [(x.min(axis=0), x.max(axis=0)) for x, _, _ in trajectories.transitions(BLOCK)]
    lower, upper = zip(*extremes, strict=True)
    return np.stack([np.min(lower, axis=0), np.max(upper, axis=0)])
