"""A predictor from measured data: the increment of a state regressed on it, its past and inputs, eqs. (10.2) to (10.5).

A ridge on increments draws a fit towards a state that is held, where one on the next state draws it to zero.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.koopman.bases.basis import Basis, BasisChoice
from koopcli.koopman.bases.polynomial import Polynomial, Polynomials
from koopcli.koopman.edmd.centred import affine, together
from koopcli.koopman.edmd.passes import here
from koopcli.koopman.edmd.survey import Survey, survey
from koopcli.koopman.edmd.transitions import Record, Transitions, Windows
from koopcli.koopman.predictor.coverage import coverage_of
from koopcli.koopman.predictor.dynamics.bilinear import Bilinear
from koopcli.koopman.predictor.dynamics.linear import Linear
from koopcli.koopman.predictor.memory import Memory, flat
from koopcli.koopman.predictor.predictor import Predictor
from koopcli.koopman.predictor.regression import Regression
from koopcli.progress import Progress, silent
from koopcli.records import Channels, FloatArray

RIDGE = 1e-5  # of columns of spread one: more only hurts, less keeps what nearly equal past rows leave open
HELD = 1 << 20  # numbers of columns that are held together
ROWS = (1 << 8, 1 << 14)  # the fewest pairs read together, and the most


def fit_increments(
    data: Record | Transitions,
    basis: BasisChoice | Basis,
    memory: int,
    products: bool,
    ridge: float = RIDGE,
    progress: Progress = silent,
) -> Predictor:
    """z⁺ = A z + B u, with ``products`` + Σ_i u_i N_i z where N_i acts on the present states alone, by least squares.

    z = [ψ(x_k), x_{k-1}, …, x_{k-p}, u_{k-1}, …, u_{k-p}] with p = ``memory`` steps; ψ is the ``basis``, or the one
    that such a choice makes of the data. ψ(x_{k+1}) - ψ(x_k) is regressed on z, u and the products u_i x_k as in
    :func:`koopcli.koopman.edmd.centred.affine`; the rows of the past are exact shifts. Without memory and products, of
    [1, x], it is DMD with control. No pair and no past crosses from one episode to another.

    A state with too few different values for a degree is fitted with a lower one, which the notes of ``regression``
    say. Inputs are limited to their range in the data. Raises ``InvalidValueError`` for a basis without a constant,
    for fewer pairs than unknowns and for data that are not finite.
    """
    pairs = Transitions.of(data)
    seen = survey(pairs, here(pairs))
    if not (np.isfinite(seen.corners).all() and np.isfinite(seen.ends).all()):
        raise InvalidValueError("the training data hold values that are not finite: leave out or mend those rows")
    notes: tuple[str, ...] = ()
    if isinstance(basis, BasisChoice):
        basis, notes = chosen(basis, seen, pairs.state_channels)
    if basis.constant is None:
        raise InvalidValueError("a fit of increments needs a basis with a constant: choose the basis 'total'")
    fitted = _Columns(basis, pairs, memory, products)
    fitted.check()
    sums = together(fitted.blocks(progress))
    found = affine(sums, fitted.count, ridge)
    dynamics = fitted.dynamics(found.slopes, found.offset)
    n_x, n_u = len(pairs.state_channels), len(pairs.input_channels)
    lift = Memory(basis, memory, n_x, n_u) if memory else basis
    still = np.ptp(seen.ends, axis=0) == 0
    notes += tuple(
        f"{name} is {value:g} {unit} throughout: the fit knows nothing of it"
        for name, unit, value, never in zip(
            pairs.input_channels.names, pairs.input_channels.units, seen.ends[0], still, strict=True
        )
        if never
    )
    return Predictor(
        observables=lift,
        dynamics=dynamics,
        C=lift.state_map,
        dt=pairs.dt,
        coverage=coverage_of(seen.states, seen.corners, pairs.hull_states),
        state_channels=pairs.state_channels,
        input_channels=pairs.input_channels,
        regression=Regression(found.rank, found.directions, found.condition, "increments", notes=notes),
        plant=pairs.plant,
        limits=seen.ends,
    )


def chosen(choice: BasisChoice, seen: Survey, channels: Channels) -> tuple[Basis, tuple[str, ...]]:
    """The basis of a ``choice`` on the data, of a lower degree where a state has too few different values, and notes
    that say so.
    """
    x, notes = seen.states, []
    degrees = choice.degrees(x.shape[1])
    if isinstance(choice, Polynomials):
        distinct = [len(np.unique(values)) for values in x.T] if max(degrees) > 1 else []
        carried = max(1, min(distinct, default=2) - 1)
        for name, count, degree in zip(channels.names, distinct, degrees, strict=False):
            if count <= degree:
                notes.append(
                    f"{name} has {count} different value{'s' * (count > 1)}, too few for degree {degree}: "
                    f"fitted with degree {carried} at most"
                )
        if notes:
            orders = {name: getattr(choice, name, 0) for name in ("order", "degree_velocity")}
            choice = replace(choice, **{name: min(order, carried) for name, order in orders.items() if order > carried})
    if max(choice.degrees(x.shape[1]), default=2) > 1:
        return choice.make(x), tuple(notes)
    basis = choice.make(x, raw=True)  # 1 and the states as they are: columns are centred and scaled anyway
    assert isinstance(basis, Polynomial), "others have no degrees"
    order = np.lexsort([*-basis.degrees.T[::-1], basis.degrees.sum(axis=1)])  # 1, then states, in theirs
    return replace(basis, degrees=basis.degrees[order]), tuple(notes)


class _Columns:
    """The columns [ψ(x) without its constant, past, u, u_i x] of a regression, and the operators that it gives."""

    def __init__(self, basis: Basis, pairs: Transitions, memory: int, products: bool) -> None:
        self._basis, self._pairs, self._memory, self._products = basis, pairs, memory, products
        self._free = np.flatnonzero(np.arange(basis.functions) != basis.constant)
        n_x, n_u = len(pairs.state_channels), len(pairs.input_channels)
        widths = [len(self._free), memory * n_x, memory * n_u, n_u, n_u * n_x if products else 0]
        self._ends = np.cumsum(widths)
        self.count = int(self._ends[-1])

    def check(self) -> None:
        """Raise ``InvalidValueError`` for a past longer than every episode, or fewer pairs than unknowns."""
        pairs, memory = self._pairs, self._memory
        usable = pairs.count(memory)
        if not usable:
            raise InvalidValueError(
                f"a memory of {memory * pairs.dt:g} s is longer than every episode (the longest has "
                f"{(pairs.longest - 1) * pairs.dt:g} s): lower fit-edmd.memory, or fit longer ones"
            )
        if usable < self.count + 1:
            raise InvalidValueError(
                f"{usable} rows with {memory * pairs.dt:g} s before them cannot determine {self.count + 1} unknowns of "
                "each state: lower fit-edmd.memory or the order, or fit more data"
            )

    def blocks(self, progress: Progress) -> Iterator[FloatArray]:
        """Columns and targets side by side, (n, columns + targets), of some pairs at a time."""
        width = self.count + len(self._free)
        done, total = 0, self._pairs.count(self._memory)
        for part in self._pairs.windows(self._memory, min(max(HELD // width, ROWS[0]), ROWS[1])):
            yield self._of(part)
            done += len(part.x)
            progress(done, total)

    def _of(self, part: Windows) -> FloatArray:
        now, then = (self._basis.lift(x)[:, self._free] for x in (part.x, part.x_next))
        products = flat(part.u[:, :, np.newaxis] * part.x[:, np.newaxis]) if self._products else part.u[:, :0]
        return np.hstack([now, flat(part.past_x), flat(part.past_u), part.u, products, then - now])

    def dynamics(self, slopes: FloatArray, offset: FloatArray) -> Linear | Bilinear:
        """z⁺ = A z + B u + Σ u_i N_i z from the ``slopes`` (columns, targets) and ``offset`` of the increments."""
        basis, constant, memory, free = self._basis, self._basis.constant, self._memory, self._free
        present, past_x, past_u, inputs = np.split(slopes[: self._ends[3]].T, self._ends[:3], axis=1)
        functions, n_x, n_u = basis.functions, len(self._pairs.state_channels), len(self._pairs.input_channels)
        behind_x, behind_u = functions + memory * n_x, functions + memory * (n_x + n_u)
        A, B = np.zeros((behind_u, behind_u)), np.zeros((behind_u, n_u))
        A[constant, constant] = 1.0
        A[np.ix_(free, free)] = np.eye(len(free)) + present
        A[free, constant] = offset
        A[free, functions:behind_x], A[free, behind_x:] = past_x, past_u
        B[free] = inputs
        if memory:
            A[functions : functions + n_x, :functions] = basis.state_map
            A[functions + n_x : behind_x, functions : behind_x - n_x] = np.eye((memory - 1) * n_x)
            A[behind_x + n_u :, behind_x : behind_u - n_u] = np.eye((memory - 1) * n_u)
            B[behind_x : behind_x + n_u] = np.eye(n_u)
        if not self._products:
            return Linear(A, B)
        N = np.zeros((n_u, behind_u, behind_u))
        terms = slopes[self._ends[3] :].reshape(n_u, n_x, len(free)).transpose(0, 2, 1) @ basis.state_map
        B[free] += terms[:, :, constant].T  # what the constant has in a state is a product with the input alone
        terms[:, :, constant] = 0.0
        N[:, free, :functions] = terms
        return Bilinear(A, B, N)
