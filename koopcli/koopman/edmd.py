"""Extended dynamic mode decomposition with inputs (docs/equations.md 4)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.koopman.bases import BASES, Basis
from koopcli.koopman.coverage import Coverage, coverage_of, spread
from koopcli.koopman.predictor import Predictor
from koopcli.koopman.regression import condition_number, least_squares
from koopcli.progress import Progress, silent
from koopcli.records import FloatArray, Trajectories

BLOCK = 4096  # rows lifted together
MARGINAL_ROWS = 1 << 18  # rows that may shape the basis; the regression always reads all of them
HULL_BLOCK = 1 << 15  # states whose hull is taken together


class _Operators(NamedTuple):
    A: FloatArray
    B: FloatArray
    rank: int
    directions: int
    condition: float


def basis_from_data(trajectories: Trajectories, kind: str, order: int) -> Basis:
    """The basis ``kind`` of ``order`` on the distinct values that each state takes in the data, with their shares.

    A product dataset shows them in its states; of more than ``MARGINAL_ROWS`` other samples a spread choice shapes
    the basis, while the fit is over all of them.
    """
    if trajectories.factors is not None:
        x = _factors(trajectories, trajectories.factors)[1]
    else:
        x = _spread_rows(trajectories, MARGINAL_ROWS)
    nodes = []
    for column in x.T:
        values, counts = np.unique(column, return_counts=True)
        nodes.append((values, counts / counts.sum()))
    return BASES[kind].make(nodes, order)


def _spread_rows(trajectories: Trajectories, limit: int) -> FloatArray:
    """At most ``limit`` states that a step starts from."""
    chosen = spread(len(trajectories) * trajectories.steps, limit)
    found, start = [], 0
    for x, _, _ in trajectories.transitions(BLOCK):
        first, last = np.searchsorted(chosen, [start, start + len(x)])
        found.append(x[chosen[first:last] - start])
        start += len(x)
    return np.concatenate(found)


def fit(trajectories: Trajectories, basis: Basis, progress: Progress = silent) -> Predictor:
    """A, B of ψ(x⁺) ≈ A ψ(x) + B u by least squares over all one-step pairs (4.4); C is exact.

    On a product dataset of one step ψ(x) takes few distinct values and ψ(x⁺) can be averaged over the inputs first,
    which is the same minimum for a fraction of the work (4.5); any other dataset is read in blocks. Raises
    ``InvalidValueError`` for fewer samples than unknowns and for data that are not finite.
    """
    samples, n_u = len(trajectories) * trajectories.steps, len(trajectories.input_channels)
    if samples < basis.functions + n_u:
        raise InvalidValueError(
            f"{samples} samples cannot determine {basis.functions} functions and {n_u} inputs: "
            "lower the order or sample more"
        )
    if trajectories.factors is not None and basis.constant is not None:
        A, B, rank, directions, condition = _fit_product(trajectories, trajectories.factors, basis, progress)
    else:
        A, B, rank, directions, condition = _fit_blocks(trajectories, basis, progress)
    return Predictor(
        observables=basis,
        A=A,
        B=B,
        C=basis.state_map,
        dt=trajectories.dt,
        coverage=coverage(trajectories),
        state_channels=trajectories.state_channels,
        input_channels=trajectories.input_channels,
        rank=rank,
        directions=directions,
        condition=condition,
        spectral_radius=float(np.abs(np.linalg.eigvals(A)).max()),
        plant=trajectories.plant,
    )


def _fit_blocks(trajectories: Trajectories, basis: Basis, progress: Progress) -> _Operators:
    """Least squares on the rows [ψ(x), u], read in blocks; u is centred where the basis has a constant.

    Inputs that never move stay out of the regression, where they would only spoil its condition.
    """
    N, total = basis.functions, len(trajectories) * trajectories.steps
    u_mean = np.zeros(len(trajectories.input_channels))
    if basis.constant is not None:
        u_mean = sum((u.sum(axis=0) for _, u, _ in trajectories.transitions(BLOCK)), u_mean) / total
    moving = np.zeros(len(u_mean), dtype=bool)
    for _, u, _ in trajectories.transitions(BLOCK):
        moving |= _centred(u, u_mean).any(axis=0)

    def rows() -> Iterator[tuple[FloatArray, FloatArray]]:
        done = 0
        for x, u, x_next in trajectories.transitions(BLOCK):
            yield np.hstack([basis.lift(x), _centred(u, u_mean)[:, moving]]), basis.lift(x_next)
            done += len(x)
            progress(done, total)

    solution = least_squares(rows)
    A, B = solution.coefficients[:N].T.copy(), np.zeros((N, len(u_mean)))
    B[:, moving] = solution.coefficients[N:].T
    directions = N + int(moving.sum())
    return _Operators(_fold(A, B, u_mean, basis), B, solution.rank, directions, solution.condition)


def _fit_product(trajectories: Trajectories, product: tuple[int, int], basis: Basis, progress: Progress) -> _Operators:
    """The same minimum from the mean and the slope of ψ(x⁺) over the inputs of each state (4.5).

    The centred inputs are orthogonal to every ψ(x), so A and B separate.
    """
    states, m = product
    columns, x = _factors(trajectories, product)
    u_mean = columns.mean(axis=0)
    centred = _centred(columns, u_mean)
    length = np.linalg.norm(centred, axis=0)
    moving = length > 0
    left, singular, right = np.linalg.svd(centred[:, moving] / length[moving], full_matrices=False)
    keep = singular > singular.max(initial=0.0) * np.finfo(float).eps * m
    slopes = np.zeros(columns.shape)  # Σ_j slopes_j u_jᵀ is the identity on the inputs that move
    slopes[:, moving] = (left[:, keep] / singular[keep]) @ right[keep] / length[moving]
    weights = np.column_stack([np.full(m, 1 / m), slopes])
    slope = np.zeros((columns.shape[1], basis.functions))
    few = max(1, BLOCK // m)  # states whose successors are lifted together

    def rows() -> Iterator[tuple[FloatArray, FloatArray]]:
        slope[:] = 0
        for start in range(0, states, BLOCK):
            stop = min(start + BLOCK, states)
            mean = np.empty((stop - start, basis.functions))
            for first in range(start, stop, few):
                last = min(first + few, stop)
                x_next = trajectories.x[first * m : last * m][:, 1].reshape(last - first, m, -1)
                moments = basis.group_moments(x_next, weights)
                mean[first - start : last - start] = moments[:, 0]
                slope[:] += moments[:, 1:].sum(axis=0)
                progress(last, states)
            yield basis.lift(x[start:stop]), mean

    solution = least_squares(rows)
    A, B = solution.coefficients.T.copy(), slope.T / states
    condition = condition_number(np.concatenate([solution.singular_values, singular]))
    rank, directions = solution.rank + int(keep.sum()), basis.functions + int(moving.sum())
    return _Operators(_fold(A, B, u_mean, basis), B, rank, directions, condition)


def _centred(u: FloatArray, u_mean: FloatArray) -> FloatArray:
    """``u - u_mean`` with what is only rounding set to zero: an input that never moves determines nothing."""
    centred = u - u_mean
    centred[np.abs(centred) <= 64 * np.finfo(float).eps * np.abs(u_mean)] = 0.0
    return centred


def _fold(A: FloatArray, B: FloatArray, u_mean: FloatArray, basis: Basis) -> FloatArray:
    """A with B's share of the mean input in the column of the constant (4.5)."""
    if basis.constant is not None:
        A[:, basis.constant] -= B @ u_mean
    return A


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


def coverage(trajectories: Trajectories) -> Coverage:
    """Where the states lie that steps start from; those of a product count once."""
    if trajectories.factors is not None:
        x = _factors(trajectories, trajectories.factors)[1]
        return coverage_of(lambda: [x], len(x))
    total = len(trajectories) * trajectories.steps
    return coverage_of(lambda: (x for x, _, _ in trajectories.transitions(HULL_BLOCK)), total)
