"""Linear interpolation in the simplices of a Delaunay triangulation, found by walking (docs/equations.md 7)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.koopman.eigen.lookup.cloud import Cloud
from koopcli.koopman.eigen.lookup.lookup import Lift
from koopcli.records import BoolArray, FloatArray, IndexArray

INSIDE = -1e-10  # smallest barycentric coordinate of a place that counts as inside
PATIENT = 200  # steps after which a walk that may go in circles turns at random
MOST_STEPS = 4000
SAME = 1e-9  # nodes nearer to one another are one


class LinearInterpolation:
    """Barycentric weights of the simplex around a place; outside the hull the nearest node.

    The simplex is found by a visibility walk, all places at once: from a simplex at the nearest node, each step
    crosses the facet that the place lies farthest beyond. ``Delaunay.find_simplex`` answers the same, but first
    prepares every simplex of the triangulation. Raises ``InvalidValueError`` for nodes in a plane.
    """

    def __init__(self, cloud: Cloud) -> None:
        from scipy.spatial import Delaunay, QhullError, cKDTree  # noqa: PLC0415  (as in cloud.py)

        nodes = cloud.places
        _, kept = np.unique(np.round(nodes / SAME), axis=0, return_index=True)
        kept.sort()
        try:
            triangulation = Delaunay(nodes[kept])
        except (QhullError, ValueError) as error:
            raise InvalidValueError(
                f"the {len(kept)} different nodes cannot be triangulated, for they lie in a plane or are too few: "
                "simulate more trajectories (sample.budget or sample.count), or choose the lift 'nearest'"
            ) from error
        corners = np.flatnonzero(triangulation.vertex_to_simplex >= 0)  # coplanar ones may be left out
        self._nodes, self._kept, self._corners = nodes[kept], kept, corners
        self._simplices, self._neighbours = triangulation.simplices, triangulation.neighbors
        self._start = triangulation.vertex_to_simplex[corners]
        self._tree = cKDTree(self._nodes[corners])

    def __call__(self, y: FloatArray) -> tuple[IndexArray, FloatArray]:
        """Corners (n, n_x + 1) of the simplex around each of ``y`` (n, n_x), and its barycentric coordinates."""
        nearest = np.asarray(self._tree.query(y)[1], dtype=np.intp)
        simplex, weights, outside = self._walk(y, self._start[nearest])
        indices = np.asarray(self._simplices[simplex], dtype=np.intp)
        indices[outside] = self._corners[nearest[outside], np.newaxis]
        weights[outside] = np.eye(1, weights.shape[1])
        return self._kept[indices], weights

    def _walk(self, y: FloatArray, start: IndexArray) -> tuple[IndexArray, FloatArray, BoolArray]:
        """The simplex of each place, its coordinates there, and which places are outside of all."""
        at = start.astype(np.intp)
        weights = np.zeros((len(y), y.shape[1] + 1))
        outside = np.zeros(len(y), dtype=bool)
        walking = np.arange(len(y))
        chance = np.random.default_rng(0)
        for step in range(MOST_STEPS):
            if not len(walking):
                break
            here = _barycentric(self._nodes[self._simplices[at[walking]]], y[walking])
            worst = here.argmin(axis=1)
            done = here[np.arange(len(here)), worst] >= INSIDE
            if step > PATIENT:
                worst = np.where(here < INSIDE, chance.random(here.shape), -1.0).argmax(axis=1)
            weights[walking[done]] = here[done]
            on = self._neighbours[at[walking], worst]
            outside[walking[~done & (on < 0)]] = True
            going = ~done & (on >= 0)
            walking, on = walking[going], on[going]
            at[walking] = on
        outside[walking] = True
        return at, weights, outside


def _barycentric(corners: FloatArray, y: FloatArray) -> FloatArray:
    """Coordinates (n, n_x + 1) of ``y`` (n, n_x) in simplices (n, n_x + 1, n_x), by Cramer's rule: ratios of signed
    volumes (7.17), which stay right for slivers. A simplex without volume counts as missed.
    """
    edges = corners[:, :-1] - corners[:, -1:]
    place = y - corners[:, -1]
    n_x = y.shape[1]
    if n_x == 3:
        a, b, c = edges[:, 0], edges[:, 1], edges[:, 2]
        across = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)
        volume = (a * across[:, 0]).sum(axis=1)
        parts = (across * place[:, np.newaxis]).sum(axis=2)
    else:
        volume = np.linalg.det(edges)
        parts = np.empty((len(y), n_x))
        for i in range(n_x):
            moved = edges.copy()
            moved[:, i] = place
            parts[:, i] = np.linalg.det(moved)
    first = parts / np.where(volume == 0, np.finfo(float).tiny, volume)[:, np.newaxis]
    return np.column_stack([first, 1 - first.sum(axis=1)])


@dataclass(frozen=True)
class LinearLift(Lift):
    """Linear between samples (Delaunay)."""

    kind: ClassVar[str] = "linear"
    beyond = "take the nearest sample"

    def make(self, nodes: Cloud) -> LinearInterpolation:
        """The lookup among ``nodes``."""
        return LinearInterpolation(nodes)
