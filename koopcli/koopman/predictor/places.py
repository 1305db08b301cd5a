"""Where states lie for whoever asks how far apart they are (docs/equations.md 7)."""

from __future__ import annotations

import numpy as np

from koopcli.records import FloatArray

TINY = 1e-12


def placed(x: FloatArray, scale: FloatArray, power: float = 1.0) -> FloatArray:
    """The places y |y|^(power - 1), y = x / scale, of the states ``x`` (n, n_x), (n, n_x), eq. (7.12).

    A ``power`` below one spreads out the middle.
    """
    y = x / scale
    if power == 1.0:
        return np.asarray(y)
    radius = np.maximum(np.linalg.norm(y, axis=1, keepdims=True), TINY)
    return np.asarray(y * radius ** (power - 1))
