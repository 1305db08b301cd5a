"""The errors of a predictor from data where trajectories are held back (docs/equations.md 7)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.koopman.eigen.futures import Futures
from koopcli.koopman.predictor.coverage import spread
from koopcli.koopman.predictor.trust import Trust, calibrated
from koopcli.koopman.scores.metrics import rmse
from koopcli.progress import Progress, silent
from koopcli.records import FloatArray, IndexArray

FOLDS = 10  # parts of the trajectories, each predicted from the others
SCORED = 3000  # states at which errors are measured
SMALLEST = 1e-6  # percent: errors are compared by their logarithms


def held_back(
    futures: Futures,
    known: int,
    groups: IndexArray,
    predict: Callable[[Futures, FloatArray], FloatArray],
    progress: Progress = silent,
    scored: int = SCORED,
) -> Trust:
    """The estimate for ``futures``, from predicting some of its samples without the trajectories of their group.

    ``known``: the last sample whose whole future is data and no continuation; ``groups`` (J,): trajectories of one
    group, such as mirror images, are held back together; ``predict(part, x0)`` gives what a predictor of a part of the
    nodes says, (n, horizon + 1, n_x); ``scored``: at how many samples.
    """
    nodes, horizon = futures.nodes, futures.horizon
    members = np.unique(groups)
    _, first = np.unique(groups, return_index=True)
    count = known + 1
    chosen = spread(len(first) * count, scored)
    j, k = first[chosen // count], chosen % count
    truth = futures.trajectories[j[:, np.newaxis], k[:, np.newaxis] + np.arange(horizon + 1)]
    x = truth[:, 0]
    fold = np.random.default_rng(0).permutation(len(members)) % min(FOLDS, len(members))
    of_group = fold[np.searchsorted(members, groups)]
    error = np.empty(len(x))
    folds = np.unique(fold)
    for done, group in enumerate(folds):
        progress(done, len(folds))
        rows = np.flatnonzero(of_group[j] == group)
        rest = nodes.only(np.flatnonzero(of_group[nodes.trajectory] != group))
        asked = len(rows) * nodes.search.lift.neighbours * -(-horizon // futures.ahead)
        part = replace(futures, nodes=rest, tabled=asked > len(rest.kept))
        try:
            error[rows] = rmse(predict(part, x[rows]), truth[rows])
        except InvalidValueError as reason:
            raise InvalidValueError(f"with trajectories held back for fit-eigen.trust, {reason}") from reason
    known_error = np.isfinite(error)
    scale, power = nodes.search.scale, nodes.search.power
    return calibrated(x[known_error], np.maximum(error[known_error], SMALLEST), groups[j[known_error]], scale, power)
