"""Moving least squares: a linear function of the place, fitted afresh around every place (docs/equations.md 7)."""

from __future__ import annotations

import numpy as np

from koopcli.koopman.modes import IndexArray
from koopcli.records import FloatArray

WIDTH = 0.6  # of the Gaussian weights, over the distance to the farthest neighbour
RIDGE = 1e-3  # on the slopes, over the sum of the weights
TINY = 1e-12


class MovingLeastSquares:
    """The value at a place of the linear function that fits the ``neighbours`` nearest nodes best, near ones more.

    ``nodes`` (N, n_x). Smooth, and blind to nodes' values but for their trend: nodes are not met exactly.
    """

    def __init__(self, nodes: FloatArray, neighbours: int) -> None:
        from scipy.spatial import cKDTree  # noqa: PLC0415  (as in nearest.py)

        self._nodes, self._neighbours = nodes, neighbours
        self._tree = cKDTree(nodes)

    def __call__(self, y: FloatArray) -> tuple[IndexArray, FloatArray]:
        """The neighbours (n, q) of each of ``y`` (n, n_x) and what each of their values counts."""
        distance, found = self._tree.query(y, self._neighbours)
        width = WIDTH * distance[:, -1:] + TINY
        weight = np.exp(-((distance / width) ** 2))
        terms = np.concatenate(
            [np.ones((*found.shape, 1)), (self._nodes[found] - y[:, np.newaxis]) / width[..., np.newaxis]], axis=2
        )
        weighted = terms * weight[..., np.newaxis]
        gram = np.matmul(weighted.transpose(0, 2, 1), terms)
        slopes = np.diag([0.0] + [1.0] * y.shape[1])
        gram += RIDGE * weight.sum(axis=1)[:, np.newaxis, np.newaxis] * slopes
        constant = np.zeros((*gram.shape[:2], 1))
        constant[:, 0] = 1.0
        return np.asarray(found, dtype=np.intp), np.matmul(weighted, np.linalg.solve(gram, constant))[..., 0]
