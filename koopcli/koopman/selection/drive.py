"""What the inputs do in a log (10.11): how far they explain the states, whether training saw what is asked of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from koopcli.koopman.selection.blocks import Fold, Piece, joined, row_numbers
from koopcli.koopman.selection.windows import nearest
from koopcli.records import BoolArray, FloatArray

LATER = 0.5  # s over which the change of a state is explained


def explained(x: FloatArray, u: FloatArray, pieces: Sequence[Piece], dt: float, products: bool = False) -> FloatArray:
    """How well the mean input explains the change of each state over the next 0.5 s: the gain in R², (n_x,).

    The gain is over the state x (rows, n_x) at the start alone; u (rows, n_u). ``products``: the mean input times that
    state explains as well. Zero where a state does not change, and where no piece is so long.
    """
    steps = nearest(LATER, dt)
    rows = joined([np.arange(piece.start, piece.stop - steps) for piece in pieces])
    if len(rows) <= (x.shape[1] + 1) * (u.shape[1] + 1):
        return np.zeros(x.shape[1])
    total = np.concatenate([np.zeros((1, u.shape[1])), np.cumsum(u - u.mean(axis=0), axis=0)])
    mean_input = (total[rows + steps] - total[rows]) / steps
    change = x[rows + steps] - x[rows]
    alone = _r_squared(x[rows], change)
    columns = [x[rows], mean_input]
    if products:
        columns.append((mean_input[:, :, None] * x[rows][:, None, :]).reshape(len(rows), -1))
    return np.clip(_r_squared(np.concatenate(columns, axis=1), change) - alone, 0.0, 1.0)


def _r_squared(columns: FloatArray, target: FloatArray) -> FloatArray:
    spread = columns.std(axis=0)
    centred = (columns - columns.mean(axis=0)) / np.where(spread > 0, spread, 1.0)
    target = target - target.mean(axis=0)
    missed = target - centred @ np.linalg.lstsq(centred, target, rcond=None)[0]
    power = (target**2).sum(axis=0)
    return np.where(power > 0, 1.0 - (missed**2).sum(axis=0) / np.where(power > 0, power, 1.0), 0.0)


def beyond(u: FloatArray, folds: Sequence[Fold]) -> FloatArray:
    """The range of each input in a held-out block over that in its training rows, the largest of all blocks, (n_u,).

    Not a number for an input that never moves; infinite for one that moves in a held-out block alone.
    """
    worst = np.full(u.shape[1], np.nan)
    for fold in folds:
        held, seen = (np.ptp(u[row_numbers(pieces)], axis=0) for pieces in (fold.held, fold.training))
        ratio = np.where(seen > 0, held / np.where(seen > 0, seen, 1.0), np.where(held > 0, np.inf, np.nan))
        worst = np.fmax(worst, ratio)
    return worst


def outside(values: FloatArray, fold: Fold) -> BoolArray:
    """Which held-out rows of ``values`` (rows, n) lie outside the box of the training rows, (held-out rows,)."""
    seen, held = values[row_numbers(fold.training)], values[row_numbers(fold.held)]
    return np.asarray(((held < seen.min(axis=0)) | (held > seen.max(axis=0))).any(axis=1))
