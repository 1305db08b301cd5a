"""The nodes of a lookup, and which of them are the neighbours of a place."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from koopcli.records import BoolArray, FloatArray, IndexArray

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
        chosen = _spaced(self.trajectory[pool], self.sample[pool], self.spacing)
        positions = np.arange(pool.shape[1])
        rank = np.where(chosen, positions, positions + pool.shape[1])  # the others follow, where there are too few
        order = np.sort(np.argsort(rank, axis=1)[:, : self.neighbours], axis=1)
        return np.asarray(np.take_along_axis(pool, order, axis=1))

    def _nearest(self, y: FloatArray, count: int) -> IndexArray:
        indices = np.asarray(self._tree.query(y, count, workers=-1)[1], dtype=np.intp)
        return indices.reshape(len(y), count)

    @cached_property
    def _tree(self) -> Any:
        from scipy.spatial import cKDTree  # noqa: PLC0415  (what only reads a predictor goes without)

        return cKDTree(self.places)


def _spaced(trajectory: IndexArray, sample: IndexArray, spacing: int) -> BoolArray:
    """Which of each row of nodes, the nearest first, are a multiple of ``spacing`` from the first of theirs, (n, m)."""
    n, m = trajectory.shape
    order = np.argsort(trajectory, axis=1, kind="stable")
    sorted_ = np.take_along_axis(trajectory, order, axis=1)
    begins = np.ones((n, m), dtype=bool)
    begins[:, 1:] = sorted_[:, 1:] != sorted_[:, :-1]
    first = np.maximum.accumulate(np.where(begins, np.arange(m), 0), axis=1)
    along = np.take_along_axis(sample, order, axis=1)
    apart = (along - np.take_along_axis(along, first, axis=1)) % spacing == 0
    chosen = np.empty((n, m), dtype=bool)
    np.put_along_axis(chosen, order, apart, axis=1)
    return chosen
