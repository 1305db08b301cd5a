"""The regression (10.3) that blocks are judged by: increments of the state on present, past and products, in memory."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from koopcli.blocks import blocks
from koopcli.errors import InvalidValueError
from koopcli.koopman.selection.blocks import Piece, joined, row_numbers
from koopcli.records import FloatArray, IndexArray

CHUNK = 1 << 14  # rows whose columns are in memory together
FLAT = 1e-10  # of its largest value: a column that varies less is constant
FAR = 1e6  # spreads of the training states, where a forecast that blows up is stopped


@dataclass(frozen=True)
class Rung:
    """One predictor of a ladder: ``memory`` in s of past states and inputs, and ``products`` u_i x_k.

    ``order``: degree of the polynomial of the present state, 1 or 2; ``ridge``: added to the diagonal of the Gram
    matrix of standardised columns, over its rows.
    """

    memory: float = 0.2
    products: bool = False
    order: int = 1
    ridge: float = 1e-5

    def __post_init__(self) -> None:
        if self.memory < 0 or self.order not in (1, 2) or self.ridge < 0:
            raise InvalidValueError(
                f"a rung of memory {self.memory:g} s, order {self.order} and ridge {self.ridge:g} does not exist: "
                "memory and ridge are 0 or more, the order 1 or 2"
            )

    @property
    def label(self) -> str:
        """The rung in words, such as ``products, 0.2 s``."""
        parts = ["products" if self.products else "linear", f"{self.memory:g} s"]
        return ", ".join(parts + (["degree 2"] if self.order == 2 else []))

    def past(self, dt: float) -> int:
        """The steps of its memory."""
        return round(self.memory / dt)


DMDC = Rung(memory=0.0)  # DMD with control


@dataclass(frozen=True, eq=False)
class Regression:
    """A fitted ``rung``: x_{k+1} = x_k + columns @ ``gain`` (columns, n_x) + ``constant`` (n_x,), with a step of dt.

    ``past`` steps of memory; inputs are limited to ``low`` and ``high`` (n_u,), what training saw; a forecast stops
    at ``floor`` and ``ceiling`` (n_x,), far away from the training states.
    """

    rung: Rung
    past: int
    gain: FloatArray
    constant: FloatArray
    low: FloatArray
    high: FloatArray
    floor: FloatArray
    ceiling: FloatArray

    def predict(self, x: FloatArray, u: FloatArray, starts: IndexArray, steps: int) -> FloatArray:
        """Forecasts (windows, steps, n_x) of x (rows, n_x) from each row of ``starts`` with the inputs u (rows, n_u).

        A window reads the states up to its start, ``past`` rows back, and the inputs until ``steps`` after it.
        """
        p, n_x = self.past, x.shape[1]
        held = np.clip(u[starts[:, None] + np.arange(-p, steps)], self.low, self.high)
        states = np.empty((len(starts), p + 1 + steps, n_x))
        states[:, : p + 1] = x[starts[:, None] + np.arange(-p, 1)]
        for k in range(p, p + steps):
            columns = _columns(states[:, k - p : k + 1], held[:, k - p : k + 1], self.rung)
            moved = states[:, k] + columns @ self.gain + self.constant
            states[:, k + 1] = np.clip(moved, self.floor, self.ceiling)
        return states[:, p + 1 :]


def fit(x: FloatArray, u: FloatArray, pieces: Sequence[Piece], rung: Rung, dt: float) -> Regression:
    """The ``rung`` fitted to the rows of ``pieces`` of x (rows, n_x) and u (rows, n_u), every ``dt`` s.

    Raises ``InvalidValueError`` where no piece is longer than the memory and one step.
    """
    past = rung.past(dt)
    rows = pair_rows(pieces, past)
    if len(rows) == 0:
        raise InvalidValueError(
            f"no episode is longer than the memory of {rung.memory:g} s and one step: record longer, or remember less"
        )
    mean, mean_step, peak = _means(x, u, rows, rung, past)
    gram = np.zeros((len(mean), len(mean)))
    cross = np.zeros((len(mean), x.shape[1]))
    for columns, increment in _chunks(x, u, rows, rung, past):
        centred = columns - mean
        gram += centred.T @ centred
        cross += centred.T @ (increment - mean_step)
    spread = np.sqrt(np.diag(gram) / len(rows))
    kept = spread > FLAT * peak
    scale = np.where(kept, spread, 1.0)
    normal = (gram / np.outer(scale, scale) / len(rows))[np.ix_(kept, kept)]
    gain = np.zeros_like(cross)
    right = (cross / scale[:, None] / len(rows))[kept]
    gain[kept] = np.linalg.solve(normal + rung.ridge * np.eye(len(right)), right) / scale[kept, None]
    seen = row_numbers(pieces)
    middle, far = x[seen].mean(axis=0), FAR * np.ptp(x[seen], axis=0)
    return Regression(
        rung=rung,
        past=past,
        gain=gain,
        constant=mean_step - mean @ gain,
        low=u[seen].min(axis=0),
        high=u[seen].max(axis=0),
        floor=middle - far,
        ceiling=middle + far,
    )


def pair_rows(pieces: Sequence[Piece], past: int) -> IndexArray:
    """The rows k (pairs,) whose past and whose next row are in the same piece."""
    return joined([np.arange(piece.start + past, piece.stop - 1) for piece in pieces])


def _columns(x: FloatArray, u: FloatArray, rung: Rung) -> FloatArray:
    """Columns (n, columns): x, its monomials of degree 2, u, past x and u, and products.

    x (n, past + 1, n_x) and u (n, past + 1, n_u) end with the present row.
    """
    now, held = x[:, -1], u[:, -1]
    parts = [now, held]
    if rung.order == 2:
        i, j = np.triu_indices(now.shape[1])
        parts.append(now[:, i] * now[:, j])
    for back in range(2, x.shape[1] + 1):
        parts += [x[:, -back], u[:, -back]]
    if rung.products:
        parts.append((held[:, :, None] * now[:, None, :]).reshape(len(now), -1))
    return np.concatenate(parts, axis=1)


def _chunks(
    x: FloatArray, u: FloatArray, rows: IndexArray, rung: Rung, past: int
) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Columns and increments, a part of the rows at a time."""
    for part in blocks(slice(0, len(rows)), CHUNK):
        k = rows[part]
        until = k[:, None] + np.arange(-past, 1)
        yield _columns(x[until], u[until], rung), x[k + 1] - x[k]


def _means(
    x: FloatArray, u: FloatArray, rows: IndexArray, rung: Rung, past: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Means of the columns and of the increments, and the largest absolute value of each column."""
    sums, steps, peaks = [], [], []
    for columns, increment in _chunks(x, u, rows, rung, past):
        sums.append(columns.sum(axis=0))
        steps.append(increment.sum(axis=0))
        peaks.append(np.abs(columns).max(axis=0))
    mean, mean_step = np.sum(sums, axis=0) / len(rows), np.sum(steps, axis=0) / len(rows)
    return mean, mean_step, np.max(peaks, axis=0)
