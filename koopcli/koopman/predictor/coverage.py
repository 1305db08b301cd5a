"""Where the training states lie, and how far from them another state is (docs/equations.md 5)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from koopcli.content import Content
from koopcli.records import Array, BoolArray, FloatArray, IndexArray, Packed

STATES_LIMIT = 1 << 16  # training states that are kept to measure distances from
DIRECTIONS = 256
GOLDEN = (5**0.5 - 1) / 2
ROUNDING = 1e-9  # of a half-width: a state on the hull is inside it
HULL_STATES = 5  # the most states whose convex hull is found: of six it takes seconds, of eight it does not end
MEASURED_STATES = 4  # of many measured states, whose hull has more corners


@dataclass(frozen=True, eq=False, repr=False)
class Coverage(Content):
    """``states`` (m, n_x) a spread choice of training states, ``domain`` (2, n_x) the smallest and largest of all.

    ``facets`` (f, n_x + 1) the convex hull of all of them in half-widths of the domain (its box, where they lie in a
    plane or have too many states for a hull): inside where facet · [x, 1] ≤ 0.
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
            "states": Array(self.states, ("training_state", "state"), state_units),
            "domain": Array(self.domain, ("lower_and_upper", "state"), state_units),
            "facets": Array(self.facets, ("facet", "normal_and_offset"), "1"),
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


def coverage_of(states: FloatArray, corners: FloatArray | None = None, most: int = HULL_STATES) -> Coverage:
    """The coverage of the training ``states`` (m, n_x), or of more that their hull and box hang on at ``corners``.

    ``STATES_LIMIT`` of them at most, spread evenly, are kept to measure distances from. States that lie in a plane have
    no hull, and of more than ``most`` states none is looked for; the box of the domain stands for it.
    """
    if corners is None:
        corners = corners_of(states, most)
    domain = np.stack([corners.min(axis=0), corners.max(axis=0)])
    n_x = corners.shape[1]
    hull = _hull(_in_half_widths(corners, domain)) if n_x <= most else None
    box = np.hstack([np.vstack([np.eye(n_x), -np.eye(n_x)]), -np.ones((2 * n_x, 1))])
    facets = box if hull is None else np.unique(hull.equations, axis=0)
    return Coverage(states[spread(len(states), STATES_LIMIT)], domain, facets)


def spread(total: int, limit: int) -> IndexArray:
    """At most ``limit`` of ``total`` rows, spread by multiples of the golden ratio, which no regular data can match."""
    if total <= limit:
        return np.arange(total)
    return np.unique((np.arange(limit) * GOLDEN % 1.0 * total).astype(np.intp))


def corners_of(x: FloatArray, most: int = HULL_STATES) -> FloatArray:
    """The states that the hull and the box of ``x`` hang on; of a grid or a plane all, or the corners if too many.

    Of more than ``most`` states those of the box alone.
    """
    if x.shape[1] > most:
        return np.asarray(x[np.unique(np.concatenate([x.argmin(axis=0), x.argmax(axis=0)]))])
    hull = _hull(x)
    if hull is None and len(x) <= STATES_LIMIT:
        return x
    if hull is None:  # corners of a grid or of a plane, as the farthest states in many directions
        directions = np.random.default_rng(0).standard_normal((x.shape[1], DIRECTIONS))
        vertices = np.concatenate([(x @ directions).argmax(axis=0), (x @ directions).argmin(axis=0)])
    else:
        vertices = hull.vertices
    return np.asarray(x[np.unique(np.concatenate([vertices, x.argmin(axis=0), x.argmax(axis=0)]))])


def _hull(x: FloatArray) -> Any:
    """The convex hull of ``x`` (m, n_x), None where its box is all there is to know: in a plane, and on a full grid."""
    if _fills_its_box(x):
        return None
    from scipy.spatial import ConvexHull, QhullError  # noqa: PLC0415  (a fit on a grid goes without)

    try:
        return ConvexHull(x)
    except (QhullError, ValueError):
        return None


def _fills_its_box(x: FloatArray) -> bool:
    """Whether ``x`` is a grid with every combination of its values, whose hull is its box."""
    values = 1
    for column in x.T:
        values *= len(np.unique(column))
        if values > len(x):
            return False
    return values == len(np.unique(x, axis=0))


def _in_half_widths(x: FloatArray, domain: FloatArray) -> FloatArray:
    """``x`` from the middle of the domain, in its half-widths; a state that never moves counts in its own unit."""
    half = (domain[1] - domain[0]) / 2
    return np.asarray((x - domain.mean(axis=0)) / np.where(half > 0, half, 1.0))
