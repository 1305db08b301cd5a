"""Local polyharmonic splines: r³ on the nearest nodes, and a quadratic (docs/equations.md 7)."""

from __future__ import annotations

from itertools import combinations_with_replacement

import numpy as np

from koopcli.koopman.modes import IndexArray
from koopcli.records import FloatArray

TOGETHER = 256  # places solved for at once
SOFT = 1e-9  # on the diagonal: nodes that nearly coincide share their weight


class Polyharmonic:
    """The spline of r³ with a quadratic tail through the ``neighbours`` nearest nodes, read at the place.

    ``nodes`` (N, n_x). Meets the nodes' values, and those of any quadratic function everywhere. Distances are divided
    by that of the farthest neighbour, which keeps every small system alike.
    """

    def __init__(self, nodes: FloatArray, neighbours: int) -> None:
        from scipy.spatial import cKDTree  # noqa: PLC0415  (as in nearest.py)

        self._nodes, self._neighbours = nodes, neighbours
        self._tree = cKDTree(nodes)

    def __call__(self, y: FloatArray) -> tuple[IndexArray, FloatArray]:
        """The neighbours (n, q) of each of ``y`` (n, n_x) and what each of their values counts."""
        distance, found = self._tree.query(y, self._neighbours)
        weights = np.empty(found.shape)
        for start in range(0, len(y), TOGETHER):
            rows = slice(start, start + TOGETHER)
            near = self._nodes[found[rows]] - y[rows, np.newaxis]
            weights[rows] = spline_weights(near / np.maximum(distance[rows, -1], np.finfo(float).tiny)[:, None, None])
        return np.asarray(found, dtype=np.intp), weights


def spline_weights(near: FloatArray) -> FloatArray:
    """The weights (n, q) of values at nodes ``near`` (n, q, n_x), for the value at zero.

    Solves [Φ P; Pᵀ 0] [w; ·] = [φ; p] with Φ = |y_i - y_j|³, P the monomials to degree two, φ and p those of zero.
    """
    n, q, n_x = near.shape
    square = (near**2).sum(axis=2)
    between = square[:, :, np.newaxis] + square[:, np.newaxis] - 2 * np.matmul(near, near.transpose(0, 2, 1))
    np.maximum(between, 0.0, out=between)
    between *= np.sqrt(between)
    tail = _quadratic(near)
    m = tail.shape[2]
    system = np.zeros((n, q + m, q + m))
    system[:, :q, :q] = between
    system[:, :q, q:] = tail
    system[:, q:, :q] = tail.transpose(0, 2, 1)
    diagonal = np.arange(q + m)
    system[:, diagonal[:q], diagonal[:q]] = SOFT
    system[:, diagonal[q:], diagonal[q:]] = -SOFT * 1e-3
    right = np.zeros((n, q + m, 1))
    right[:, :q, 0] = square * np.sqrt(square)
    right[:, q, 0] = 1.0
    return np.asarray(np.linalg.solve(system, right)[:, :q, 0])


def _quadratic(near: FloatArray) -> FloatArray:
    """Monomials to degree two of ``near`` (n, q, n_x), the constant first."""
    n_x = near.shape[2]
    second = [near[:, :, i] * near[:, :, j] for i, j in combinations_with_replacement(range(n_x), 2)]
    return np.stack([np.ones(near.shape[:2]), *near.transpose(2, 0, 1), *second], axis=2)
