"""The nodes of a lookup, and which of them are the neighbours of a place."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from koopcli.records import BoolArray, FloatArray, IndexArray

ALONE = 64  # places that are not worth other threads
TOGETHER = 64  # places whose neighbours are chosen at once
POOL = 3  # times as many of the nearest nodes as neighbours are chosen among


@dataclass(frozen=True)
class Cloud:
    """Nodes at ``places`` (N, n_x), each the sample number ``sample`` (N,) of a ``trajectory`` (N,).

    A place has so many ``neighbours``: the nearest, of which those on one trajectory are ``spacing`` samples apart, if
    that is given. Trajectories are dense along themselves and sparse across, and neighbours that all lie on one of them
    say nothing about any other direction.
    """

    places: FloatArray
    trajectory: IndexArray
    sample: IndexArray
    neighbours: int
    spacing: int | None = None

    def near(self, y: FloatArray) -> IndexArray:
        """The neighbours (n, q) of each of ``y`` (n, n_x), the nearest first."""
        if self.spacing is None:
            return self._nearest(y, self.neighbours)
        pool = self._nearest(y, min(POOL * self.neighbours, len(self.places)))
        near = np.empty((len(y), self.neighbours), dtype=np.intp)
        for start in range(0, len(y), TOGETHER):
            some = pool[start : start + TOGETHER]
            left_out = ~_spaced(self.trajectory[some], self.sample[some], self.spacing)
            order = np.argsort(left_out, axis=1, kind="stable")[:, : self.neighbours]  # left-out nodes fill up
            order.sort(axis=1)
            near[start : start + TOGETHER] = some[np.arange(len(some))[:, np.newaxis], order]
        return near

    def _nearest(self, y: FloatArray, count: int) -> IndexArray:
        workers = -1 if len(y) > ALONE else 1
        indices = np.asarray(self._tree.query(y, count, workers=workers)[1], dtype=np.intp)
        return indices.reshape(len(y), count)

    @cached_property
    def _tree(self) -> Any:
        from scipy.spatial import cKDTree  # noqa: PLC0415  (what only reads a predictor goes without)

        return cKDTree(self.places)


def _spaced(trajectory: IndexArray, sample: IndexArray, spacing: int) -> BoolArray:
    """Which of each row of nodes, the nearest first, are a multiple of ``spacing`` from the first of theirs, (n, m)."""
    first = (trajectory[:, :, np.newaxis] == trajectory[:, np.newaxis]).argmax(axis=2)
    return np.asarray((sample - sample[np.arange(len(sample))[:, np.newaxis], first]) % spacing == 0)
