"""Where the training states lie, and how far from them another state is (docs/equations.md 5)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from koopcli.records import Array, BoolArray, FloatArray, Packed

STATES_LIMIT = 1 << 16  # training states that are kept to measure distances from
ROUNDING = 1e-9  # of a half-width: a state on the hull is inside it


@dataclass(frozen=True)
class Coverage:
    """``states`` (m, n_x) a spread choice of training states, ``domain`` (2, n_x) the smallest and largest of all.

    ``facets`` (f, n_x + 1) the convex hull of ``states`` in half-widths of the domain: inside where
    facet · [x, 1] ≤ 0.
    """

    states: FloatArray
    domain: FloatArray
    facets: FloatArray

    def distance(self, x: FloatArray) -> FloatArray:
        """Distance of ``x`` (n, n_x) to the nearest training state, in half-widths of the domain, (n,)."""
        nearest: FloatArray = self._tree.query(_in_half_widths(x, self.domain))[0]
        return nearest

    def outside(self, x: FloatArray) -> BoolArray:
        """Which of ``x`` (n, n_x) lie outside the convex hull of the training states, (n,)."""
        place = _in_half_widths(x, self.domain) @ self.facets[:, :-1].T + self.facets[:, -1]
        return np.asarray((place > ROUNDING).any(axis=1))

    def pack(self, state_units: str) -> Packed:
        """The coverage for storage, inside a predictor."""
        arrays = {
            "states": Array(self.states, ("training state", "state"), state_units),
            "domain": Array(self.domain, ("lower and upper", "state"), state_units),
            "facets": Array(self.facets, ("facet", "normal and offset"), "1"),
        }
        return Packed(arrays)

    @classmethod
    def unpack(cls, packed: Packed) -> Coverage:
        """The inverse of :meth:`pack`."""
        return cls(**{name: array.values[...] for name, array in packed.arrays.items()})

    @cached_property
    def _tree(self) -> Any:
        from scipy.spatial import cKDTree  # noqa: PLC0415  (a fit that is read and not scored goes without)

        return cKDTree(_in_half_widths(self.states, self.domain))


def coverage_of(states: FloatArray, domain: FloatArray) -> Coverage:
    """The coverage of training ``states`` (m, n_x) with their ``domain`` (2, n_x).

    States that lie in a plane have no hull; the box of the domain stands for it.
    """
    from scipy.spatial import ConvexHull, QhullError  # noqa: PLC0415

    n_x = states.shape[1]
    try:
        facets = np.unique(ConvexHull(_in_half_widths(states, domain)).equations, axis=0)
    except (QhullError, ValueError):
        facets = np.hstack([np.vstack([np.eye(n_x), -np.eye(n_x)]), -np.ones((2 * n_x, 1))])
    return Coverage(states, domain, facets)


def _in_half_widths(x: FloatArray, domain: FloatArray) -> FloatArray:
    """``x`` from the middle of the domain, in its half-widths; a state that never moves counts in its own unit."""
    half = (domain[1] - domain[0]) / 2
    return np.asarray((x - domain.mean(axis=0)) / np.where(half > 0, half, 1.0))
