"""The choice among a few rungs, by blocks that the fit did not see (10.9)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from koopcli.koopman.selection.blocks import Holding, Pieces, folds, row_numbers
from koopcli.koopman.selection.regress import Rung, fit, pair_rows
from koopcli.koopman.selection.windows import INNER, TINY, Windows, ahead_of, rmse
from koopcli.records import FloatArray

DEFAULT = (Rung(products=False), Rung(products=True))  # linear and products, both with 0.2 s of memory
BLOCKS = 4  # inner blocks
WORSE = 1.05  # times the error of the first rung, which another may have in any one block


@dataclass(frozen=True, eq=False)
class Choice:
    """Which rung was ``picked`` (its place), and the ``scores`` (rungs, inner blocks) that decided it: mean log RMSE.

    A block that is too short for a window has none; ``blind`` says that fewer than two blocks had any: then nothing
    was compared, and the first rung is taken.
    """

    picked: int
    scores: FloatArray
    blind: bool


def pick(scores: FloatArray) -> int:
    """The rung with the lowest mean of its ``scores`` (rungs, blocks), logarithms of errors.

    A rung counts only where it is at most 1.05 × the first one in every block. Of two rungs alike the earlier is taken.
    """
    safe = (scores - scores[0] <= np.log(WORSE)).all(axis=1)
    safe[0] = True
    return int(np.argmin(np.where(safe, scores.mean(axis=1), np.inf)))


def choose(
    x: FloatArray, u: FloatArray, pieces: Pieces, rungs: Sequence[Rung], windows: Windows, holding: Holding
) -> Choice:
    """The choice among ``rungs`` on the rows of ``pieces`` of x (rows, n_x) and u (rows, n_u)."""
    scores = inner_scores(x, u, pieces, rungs, windows, holding)
    known = np.isfinite(scores).all(axis=0)
    blind = int(known.sum()) < 2
    return Choice(0 if blind else pick(scores[:, known]), scores, blind)


def inner_scores(
    x: FloatArray, u: FloatArray, pieces: Pieces, rungs: Sequence[Rung], windows: Windows, holding: Holding
) -> FloatArray:
    """Log RMSE (rungs, blocks), mean over states and horizons; not a number for a block without a window."""
    least = TINY * x[row_numbers(pieces)].std(axis=0) + np.finfo(float).tiny
    steps = np.array(list(windows.horizons.values())) - 1
    scores = np.full((len(rungs), BLOCKS), np.nan)
    for block, fold in enumerate(folds(pieces, BLOCKS, holding)):
        starts = windows.starts(fold.held, INNER)
        if len(starts) == 0 or len(pair_rows(fold.training, windows.history)) == 0:
            continue
        truth = ahead_of(x, starts, windows.ahead)
        for place, rung in enumerate(rungs):
            forecast = fit(x, u, fold.training, rung, windows.dt).predict(x, u, starts, windows.ahead)
            scores[place, block] = np.log(np.maximum(rmse(forecast - truth)[steps], least)).mean()
    return scores
