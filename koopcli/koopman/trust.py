"""How far a predictor from data can be trusted at a state: its own errors where data were held back (equations 7)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from koopcli.content import Content
from koopcli.errors import InvalidValueError
from koopcli.koopman.coverage import spread
from koopcli.koopman.futures import Futures
from koopcli.koopman.metrics import rmse
from koopcli.koopman.modes import IndexArray
from koopcli.koopman.nodes import Search
from koopcli.progress import Progress, silent
from koopcli.records import Array, FloatArray, Meta, Packed

LEVEL = 0.9
FOLDS = 10  # parts of the trajectories, each predicted from the others
SCORED = 3000  # states at which errors are measured
NEIGHBOURS = 15  # of these, whose errors are averaged
SMALLEST = 1e-6  # percent: errors are compared by their logarithms


@dataclass(frozen=True, eq=False, repr=False)
class Trust(Content):
    """An estimate of the error at any state: the mean, by logarithms, of the errors at the nearest ``states``
    (m, n_x), which were found with their own trajectories held back: ``errors`` (m,) in percent.

    A bound is ``factor`` times as large, so that a share ``level`` of the errors held back stay below theirs (7.15).
    """

    states: FloatArray
    errors: FloatArray
    scale: FloatArray
    power: float
    factor: float
    level: float = LEVEL

    def bound(self, x: FloatArray) -> FloatArray:
        """The error (n,) in percent that a prediction from ``x`` (n, n_x) stays below with the probability ``level``.

        Not a number where the state is none.
        """
        found = np.full(len(x), np.nan)
        finite = np.isfinite(x).all(axis=1)
        count = min(NEIGHBOURS, len(self.states))
        near = self._tree.query(self._search.place(x[finite]), count)[1].reshape(-1, count)
        found[finite] = self.factor * np.exp(np.log(self.errors)[near].mean(axis=1))
        return found

    @property
    def _search(self) -> Search:
        return Search("nearest", self.scale, self.power)

    @cached_property
    def _tree(self) -> Any:
        from scipy.spatial import cKDTree  # noqa: PLC0415  (what only reads a predictor goes without)

        return cKDTree(self._search.place(self.states))

    def pack(self, units: str) -> Packed:
        """The estimate for storage."""
        arrays = {
            "states": Array(self.states, ("state held back", "state"), units),
            "errors": Array(self.errors, ("state held back",), "%"),
            "scale": Array(self.scale, ("state",), units),
        }
        meta: Meta = {"power": self.power, "factor": self.factor, "level": self.level}
        return Packed(arrays, meta)

    @classmethod
    def unpack(cls, packed: Packed) -> Trust:
        """The inverse of :meth:`pack`."""
        return cls(**{name: array.values[...] for name, array in packed.arrays.items()}, **packed.meta)


def held_back(
    futures: Futures,
    known: int,
    groups: IndexArray,
    predict: Callable[[Futures, FloatArray], FloatArray],
    progress: Progress = silent,
) -> Trust:
    """The estimate for ``futures``, from predicting some of its samples without the trajectories of their group.

    ``known``: the last sample whose whole future is data and no continuation; ``groups`` (J,): trajectories of one
    group, such as mirror images, are held back together; ``predict(part, x0)`` gives what a predictor of a part of the
    nodes says, (n, horizon + 1, n_x).
    """
    nodes, horizon = futures.nodes, futures.projection.shape[1] - 1
    members = np.unique(groups)
    _, first = np.unique(groups, return_index=True)
    count = known + 1
    chosen = spread(len(first) * count, SCORED)
    j, k = first[chosen // count], chosen % count
    truth = futures.trajectories[j[:, np.newaxis], k[:, np.newaxis] + np.arange(horizon + 1)]
    x = truth[:, 0]
    fold = np.random.default_rng(0).permutation(len(members)) % min(FOLDS, len(members))
    of_group = fold[np.searchsorted(members, groups)]
    error = np.empty(len(x))
    folds = np.unique(fold)
    for done, one in enumerate(folds):
        progress(done, len(folds))
        rows = np.flatnonzero(of_group[j] == one)
        rest = nodes.only(np.flatnonzero(of_group[nodes.trajectory] != one))
        part = Futures(futures.trajectories, rest, futures.frame, futures.projection, futures.modes)
        try:
            error[rows] = rmse(predict(part, x[rows]), truth[rows])
        except InvalidValueError as reason:
            raise InvalidValueError(f"with trajectories held back for fit-eigen.trust, {reason}") from reason
    scored = np.isfinite(error)
    scale, power = nodes.search.scale, nodes.search.power
    return calibrated(x[scored], np.maximum(error[scored], SMALLEST), groups[j[scored]], scale, power)


def calibrated(x: FloatArray, error: FloatArray, groups: IndexArray, scale: FloatArray, power: float) -> Trust:
    """The estimate from ``error`` (m,) in percent at ``x`` (m, n_x).

    Its factor is found by estimating each from those of other ``groups`` (m,): a state that is asked for is on no known
    trajectory either.
    """
    trust = Trust(x, error, scale, power, 1.0)
    largest = int(np.unique(groups, return_counts=True)[1].max())
    pool = min(len(x), NEIGHBOURS + largest)
    near = trust._tree.query(trust._search.place(x), pool)[1].reshape(len(x), pool)
    others = groups[near] != groups[:, np.newaxis]
    counted = others & (np.cumsum(others, axis=1) <= NEIGHBOURS)
    size = np.log(error)
    ratio = size - (size[near] * counted).sum(axis=1) / np.maximum(counted.sum(axis=1), 1)
    return Trust(x, error, scale, power, float(np.exp(np.quantile(ratio, LEVEL, method="higher"))))
