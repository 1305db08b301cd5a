"""Extended dynamic mode decomposition with inputs (docs/equations.md 4)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.koopman.bases import BASES, Basis, Choice
from koopcli.koopman.coverage import Coverage, coverage_of, spread
from koopcli.koopman.generator import generator_of
from koopcli.koopman.inputs import WhiteInputs, white_inputs
from koopcli.koopman.predictor import Predictor
from koopcli.koopman.regression import RowBlocks, Solution, cholesky, condition_number, least_squares
from koopcli.progress import Progress, silent
from koopcli.records import FloatArray, Trajectories

BLOCK = 4096  # rows lifted together
MARGINAL_ROWS = 1 << 18  # rows that may shape the basis; the regression always reads all of them
HULL_BLOCK = 1 << 15  # states whose hull is taken together


@dataclass(frozen=True)
class Method:
    """How the regression is done: with ``bilinear`` terms u_i N_i z or without, these with the ``generator`` of the
    step or without, with a ``ridge`` (4.7), and whether by the plain normal equations of ``cholesky``.
    """

    bilinear: bool = False
    ridge: float = 0.0
    cholesky: bool = False
    generator: bool = False


class _Operators(NamedTuple):
    A: FloatArray
    B: FloatArray
    N: FloatArray | None
    rank: int
    directions: int
    condition: float


def basis_from_data(trajectories: Trajectories, choice: Choice) -> Basis:
    """The basis of a ``choice`` on the states that steps start from.

    A product dataset shows them once each; of more than ``MARGINAL_ROWS`` other samples a spread choice shapes the
    basis, while the fit is over all of them. Raises ``InvalidValueError`` for a state with too few different values.
    """
    x = _training_states(trajectories)
    channels = trajectories.state_channels
    for name, unit, values, degree in zip(
        channels.names, channels.units, x.T, BASES[choice.kind].degrees(choice, x.shape[1]), strict=False
    ):
        distinct = len(np.unique(values))
        if distinct <= degree:
            what = f"{name} is {values[0]:g} {unit} throughout" if distinct == 1 else f"{name} has {distinct} values"
            raise InvalidValueError(
                f"{what} in the training data, which carries polynomials up to degree {distinct - 1}, not {degree}: "
                "lower fit-edmd.order or fit-edmd.degree_velocity, or sample more values"
            )
    return BASES[choice.kind].make(x, choice)


def _training_states(trajectories: Trajectories) -> FloatArray:
    """The states that steps start from; of many only some."""
    if trajectories.factors is not None:
        return _factors(trajectories, trajectories.factors)[1]
    return _spread_rows(trajectories, MARGINAL_ROWS)


def _spread_rows(trajectories: Trajectories, limit: int) -> FloatArray:
    """At most ``limit`` states that a step starts from."""
    chosen = spread(len(trajectories) * trajectories.steps, limit)
    found, start = [], 0
    for x, _, _ in trajectories.transitions(BLOCK):
        first, last = np.searchsorted(chosen, [start, start + len(x)])
        found.append(x[chosen[first:last] - start])
        start += len(x)
    return np.concatenate(found)


def fit(trajectories: Trajectories, basis: Basis, method: Method = Method(), progress: Progress = silent) -> Predictor:
    """A, B and N_i of ψ(x⁺) ≈ A ψ(x) + B u + Σ_i u_i N_i ψ(x) by least squares over all one-step pairs (4.4), (4.6).

    C is exact. On a product dataset of one step ψ(x) takes few distinct values and ψ(x⁺) can be averaged over the
    inputs first, which is the same minimum for a fraction of the work (4.5); any other dataset is read in blocks, and
    so is every one by ``cholesky``, which is to show what the plain method does.
    Raises ``InvalidValueError`` for fewer samples than unknowns and for data that are not finite.
    """
    samples, n_u = len(trajectories) * trajectories.steps, len(trajectories.input_channels)
    unknowns = basis.functions * (1 + n_u) if method.bilinear else basis.functions + n_u
    if samples < unknowns:
        each = f", {unknowns} bilinear terms together" if method.bilinear else ""
        raise InvalidValueError(
            f"{samples} samples cannot determine {basis.functions} functions and {n_u} inputs{each}: "
            "lower the order or the number of centres, or sample more"
        )
    if trajectories.factors is not None and basis.constant is not None and not method.cholesky:
        A, B, N, rank, directions, condition = _fit_product(trajectories, trajectories.factors, basis, method, progress)
    else:
        A, B, N, rank, directions, condition = _fit_blocks(trajectories, basis, method, progress)
    generator = None
    if method.generator:
        assert N is not None
        assert basis.constant is not None, "a basis without a constant is refused by whoever chooses it"
        generator = generator_of(A, B, N, basis.constant, trajectories.dt)
    return Predictor(
        observables=basis,
        A=A,
        B=B,
        C=basis.state_map,
        N=N,
        generator=generator,
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


def _fit_blocks(trajectories: Trajectories, basis: Basis, method: Method, progress: Progress) -> _Operators:
    """Least squares on the rows [ψ(x), w] or [ψ(x), w ⊗ ψ(x)], read in blocks, with inputs w of mean square I."""
    total = len(trajectories) * trajectories.steps
    inputs = _all_inputs(trajectories, centred=basis.constant is not None)
    apart = basis.constant is None or not method.bilinear  # else the constant's products are the inputs themselves

    def rows() -> Iterator[tuple[FloatArray, FloatArray]]:
        done = 0
        for x, u, x_next in trajectories.transitions(BLOCK):
            z, w = basis.lift(x), inputs(u)
            columns = [z, w] if apart else [z]
            if method.bilinear:
                columns.append((w[:, :, np.newaxis] * z[:, np.newaxis, :]).reshape(len(x), w.shape[1] * z.shape[1]))
            yield np.hstack(columns), basis.lift(x_next)
            done += len(x)
            progress(done, total)

    functions, r, c = basis.functions, inputs.T.shape[1], basis.constant
    free = [] if c is None else [c]
    if c is None or apart:
        free += range(functions, functions + r)
    else:
        free += [functions * (q + 1) + c for q in range(r)]
    solution = _solve(rows, method, free)
    found = solution.coefficients.T
    A, rest = found[:, :functions], found[:, functions:]
    B = rest[:, :r] if apart else None
    N = rest[:, r if apart else 0 :].reshape(functions, r, functions).transpose(1, 0, 2) if method.bilinear else None
    missing = int(inputs.moving.sum()) - r
    directions = solution.coefficients.shape[0] + missing * (functions if method.bilinear else 1)
    return _operators(A, B, N, inputs, basis, solution, rank=solution.rank, directions=directions)


def _fit_product(
    trajectories: Trajectories, product: tuple[int, int], basis: Basis, method: Method, progress: Progress
) -> _Operators:
    """The same minimum from the mean and the slopes of ψ(x⁺) over the inputs of each state (4.5).

    The inputs w of mean zero are orthogonal to every ψ(x), so A and B separate; of mean square I they are to one
    another, so every N_i is a regression of its own slopes.
    """
    states, m = product
    columns, x = _factors(trajectories, product)
    inputs = white_inputs(lambda: [columns], centred=True)
    weights = np.column_stack([np.ones(m), inputs(columns)]) / m
    functions, r = basis.functions, inputs.T.shape[1]
    slope = np.zeros((r, functions))
    few = max(1, BLOCK // m)  # states whose successors are lifted together

    def rows() -> Iterator[tuple[FloatArray, FloatArray]]:
        slope[:] = 0
        for start in range(0, states, BLOCK):
            stop = min(start + BLOCK, states)
            targets = np.empty((stop - start, functions * (1 + r if method.bilinear else 1)))
            for first in range(start, stop, few):
                last = min(first + few, stop)
                x_next = trajectories.x[first * m : last * m][:, 1].reshape(last - first, m, -1)
                moments = basis.group_moments(x_next, weights)
                wanted = moments if method.bilinear else moments[:, 0]
                targets[first - start : last - start] = wanted.reshape(last - first, -1)
                slope[:] += moments[:, 1:].sum(axis=0)
                progress(last, states)
            yield basis.lift(x[start:stop]), targets

    assert basis.constant is not None
    solution = _solve(rows, method, [basis.constant])
    A = solution.coefficients[:, :functions].T
    B = N = None
    if method.bilinear:
        N = solution.coefficients[:, functions:].reshape(functions, r, functions).transpose(1, 2, 0)
    else:
        B = slope.T / states
    each = functions if method.bilinear else 1
    directions = functions + each * int(inputs.moving.sum())
    rank = solution.rank * (1 + r) if method.bilinear else solution.rank + r
    return _operators(A, B, N, inputs, basis, solution, rank=rank, directions=directions)


def _solve(rows: RowBlocks, method: Method, free: list[int]) -> Solution:
    """The ridge leaves the constant and B ``free``, which the data determine well."""
    return cholesky(rows) if method.cholesky else least_squares(rows, method.ridge, free)


def _all_inputs(trajectories: Trajectories, *, centred: bool) -> WhiteInputs:
    return white_inputs(lambda: (u for _, u, _ in trajectories.transitions(BLOCK)), centred=centred)


def _operators(
    A: FloatArray,
    B: FloatArray | None,
    N: FloatArray | None,
    inputs: WhiteInputs,
    basis: Basis,
    solution: Solution,
    *,
    rank: int,
    directions: int,
) -> _Operators:
    """A, B (N, n_u) and N (n_u, N, N) for u instead of w, each term in one place.

    ``A`` (N, N), ``B`` (N, r), ``N`` (r, N, N) are those of w; without ``B`` the constant's column of ``N`` holds it.
    What the mean input adds goes into A, and the constant's products with an input into B.
    """
    A, c = A.copy(), basis.constant
    in_B = np.zeros((len(A), len(inputs.mean))) if B is None else B @ inputs.T.T
    terms = None if N is None else np.tensordot(inputs.T, N, axes=1)
    if terms is not None:
        A -= np.tensordot(inputs.mean, terms, axes=1)
        if c is not None:
            in_B = in_B + terms[:, :, c].T
            terms[:, :, c] = 0.0
    if c is not None and B is not None:
        A[:, c] -= in_B @ inputs.mean
    for found in (A, in_B, terms):
        if found is not None and not np.isfinite(found).all():
            raise InvalidValueError("the regression left the finite numbers: lower the order, or use a --ridge")
    condition = condition_number(np.concatenate([solution.singular_values, inputs.singular]))
    return _Operators(A, in_B, terms, rank, directions, condition)


def why_deficient(trajectories: Trajectories, predictor: Predictor) -> str:
    """What in the data leaves directions of a fit open, in words; nothing where it is their dependence alone."""
    causes = []
    x, functions = _training_states(trajectories), predictor.functions
    distinct = len(np.unique(x, axis=0))
    if distinct < functions:
        causes.append(f"they hold {distinct} different states for {functions} functions")
    still = [name for name, values in zip(trajectories.state_channels.names, x.T, strict=True) if not np.ptp(values)]
    if still:
        causes.append(f"{', '.join(still)} never changes")
    inputs = _all_inputs(trajectories, centred=True)
    if inputs.T.shape[1] < inputs.moving.sum():
        causes.append("inputs move only together")
    return " and ".join(causes)


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
