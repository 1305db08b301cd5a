"""How far a predictor from data can be trusted at a state: an estimate of its error there (docs/equations.md 7)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from koopcli.content import Content
from koopcli.koopman.predictor.places import placed
from koopcli.records import Array, FloatArray, IndexArray, Meta, Packed

LEVEL = 0.9
NEIGHBOURS = 15  # errors that are averaged


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
        bounds = np.full(len(x), np.nan)
        finite = np.isfinite(x).all(axis=1)
        count = min(NEIGHBOURS, len(self.states))
        near = self._tree.query(placed(x[finite], self.scale, self.power), count)[1].reshape(-1, count)
        bounds[finite] = self.factor * np.exp(np.log(self.errors)[near].mean(axis=1))
        return bounds

    @cached_property
    def _tree(self) -> Any:
        from scipy.spatial import cKDTree  # noqa: PLC0415  (what only reads a predictor goes without)

        return cKDTree(placed(self.states, self.scale, self.power))

    def pack(self, units: str) -> Packed:
        """The estimate for storage."""
        arrays = {
            "states": Array(self.states, ("state_held_back", "state"), units),
            "errors": Array(self.errors, ("state_held_back",), "%"),
            "scale": Array(self.scale, ("state",), units),
        }
        meta: Meta = {"power": self.power, "factor": self.factor, "level": self.level}
        return Packed(arrays, meta)

    @classmethod
    def unpack(cls, packed: Packed) -> Trust:
        """The inverse of :meth:`pack`."""
        return cls(**{name: array.values[...] for name, array in packed.arrays.items()}, **packed.meta)


def calibrated(x: FloatArray, error: FloatArray, groups: IndexArray, scale: FloatArray, power: float) -> Trust:
    """The estimate from ``error`` (m,) in percent at ``x`` (m, n_x).

    Its factor is found by estimating each from those of other ``groups`` (m,): a state that is asked for is on no known
    trajectory either.
    """
    trust = Trust(x, error, scale, power, 1.0)
    largest = int(np.unique(groups, return_counts=True)[1].max())
    pool = min(len(x), NEIGHBOURS + largest)
    near = trust._tree.query(placed(x, scale, power), pool)[1].reshape(len(x), pool)
    others = groups[near] != groups[:, np.newaxis]
    counted = others & (np.cumsum(others, axis=1) <= NEIGHBOURS)
    size = np.log(error)
    ratio = size - (size[near] * counted).sum(axis=1) / np.maximum(counted.sum(axis=1), 1)
    return Trust(x, error, scale, power, float(np.exp(np.quantile(ratio, LEVEL, method="higher"))))
