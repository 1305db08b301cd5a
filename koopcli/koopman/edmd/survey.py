"""What one pass over the samples shows before anything is fitted to them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.koopman.edmd.passes import Found, Over
from koopcli.koopman.edmd.regression import add_rows
from koopcli.koopman.edmd.transitions import Transitions
from koopcli.koopman.predictor.coverage import corners_of, spread
from koopcli.progress import Progress
from koopcli.records import FloatArray, Packed, Trajectories

READ = 1 << 15  # samples read together; the hull is taken of as many states at a time
MARGINAL_ROWS = 1 << 18  # states that may shape a basis; a regression always reads all of them
FEW = 4096  # samples of a product read together


@dataclass(frozen=True)
class Survey:
    """``states`` (m, n_x) that steps start from: all, or ``MARGINAL_ROWS`` spread evenly.

    ``corners`` (c, n_x) are those that their hull and box hang on; ``triangle`` (1 + n_u, 1 + n_u) is the R of a QR
    factorisation of [1, u], and ``ends`` (2, n_u) the smallest and largest of each input. A product dataset counts
    every state once, and every input in ``columns`` (m, n_u) once.
    """

    states: FloatArray
    corners: FloatArray
    triangle: FloatArray
    ends: FloatArray
    columns: FloatArray | None = None


@dataclass(frozen=True)
class Look:
    """The pass of a survey."""

    bytes: ClassVar[float] = 8e6  # of states, whose number is bounded

    def __call__(self, data: Transitions, span: slice, progress: Progress) -> Found:
        """States, corners and the triangle of a part of the samples."""
        chosen = spread(len(data), MARGINAL_ROWS)
        n_u = len(data.input_channels)
        triangle, ends = np.empty((0, 1 + n_u)), np.empty((0, n_u))
        states, corners, start = [], None, span.start
        for x, u, _ in data.blocks(READ, span):
            first, last = np.searchsorted(chosen, [start, start + len(x)])
            states.append(x[chosen[first:last] - start])
            corners = corners_of(x if corners is None else np.concatenate([corners, x]), data.hull_states)
            triangle, ends = add_inputs(triangle, u), _ends(ends, u)
            start += len(x)
            progress(start - span.start, span.stop - span.start)
        assert corners is not None, "there is at least one sample"
        return {"states": np.concatenate(states), "corners": corners, "triangle": triangle, "ends": ends}

    def pack(self) -> Packed:
        """Nothing but its kind."""
        return Packed({}, {"kind": "look"})

    @classmethod
    def unpack(cls, packed: Packed) -> Look:
        """The inverse of :meth:`pack`."""
        return cls()


def survey(data: Transitions, over: Over) -> Survey:
    """The survey of ``data``. Raises ``InvalidValueError`` for a product that is marked as one and is not."""
    product = data.product
    if product is not None:
        columns, states = product_factors(product)
        triangle = add_inputs(np.empty((0, 1 + columns.shape[1])), columns)
        return Survey(states, corners_of(states), triangle, _ends(columns), columns)
    parts = list(over(Look()))
    corners = parts[0]["corners"]
    for part in parts[1:]:
        corners = corners_of(np.concatenate([corners, part["corners"]]), data.hull_states)
    triangle = parts[0]["triangle"]
    for part in parts[1:]:
        triangle = add_rows(triangle, part["triangle"])
    ends = _ends(*(part["ends"] for part in parts))
    return Survey(np.concatenate([part["states"] for part in parts]), corners, triangle, ends)


def add_inputs(triangle: FloatArray, u: FloatArray) -> FloatArray:
    """The R of [1, u] with more rows ``u`` (n, n_u)."""
    rows = np.hstack([np.ones((len(u), 1)), u])
    return add_rows(triangle, rows)


def _ends(*inputs: FloatArray) -> FloatArray:
    """The smallest and largest (2, n_u) of each of the ``inputs`` (n, n_u)."""
    every = np.concatenate(inputs)
    return np.stack([every.min(axis=0), every.max(axis=0)])


def product_factors(trajectories: Trajectories) -> tuple[FloatArray, FloatArray]:
    """The input columns (m, n_u) and the states (n, n_x) of one-step pairs, after checking that they are a product."""
    assert trajectories.factors is not None, "marked as a product"
    states, m = trajectories.factors
    columns: FloatArray = trajectories.u[:m][:, 0]
    x = np.empty((states, len(trajectories.state_channels)))
    block = max(1, FEW // m)
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
