"""The nearest node alone."""

from __future__ import annotations

import numpy as np

from koopcli.koopman.modes import IndexArray
from koopcli.records import FloatArray


class Nearest:
    """The node nearest to a place, (7.6). ``nodes`` (N, n_x)."""

    def __init__(self, nodes: FloatArray) -> None:
        from scipy.spatial import cKDTree  # noqa: PLC0415  (what only reads a predictor goes without)

        self._tree = cKDTree(nodes)

    def __call__(self, y: FloatArray) -> tuple[IndexArray, FloatArray]:
        """Index (n, 1) and weight one for each of ``y`` (n, n_x)."""
        found = np.asarray(self._tree.query(y)[1], dtype=np.intp)
        return found[:, np.newaxis], np.ones((len(y), 1))
