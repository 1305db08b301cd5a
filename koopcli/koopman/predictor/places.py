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


def place_slopes(x: FloatArray, scale: FloatArray, power: float = 1.0) -> FloatArray:
    """The derivative (n, n_x, n_x) of the places of ``x`` (n, n_x) in x: row a, column b holds that of place a in x_b.

    |y|^(power - 1) (1 + (power - 1) y yᵀ / |y|²) / scale. With a ``power`` below one it grows without limit at zero.
    """
    if power == 1.0:
        return np.broadcast_to(np.diag(1 / scale), (*x.shape, x.shape[1]))
    y = x / scale
    radius = np.maximum(np.sqrt(np.einsum("ni,ni->n", y, y)), TINY)[:, np.newaxis, np.newaxis]
    along = y[:, np.newaxis] / radius
    slopes = np.eye(x.shape[1]) + (power - 1) * along.transpose(0, 2, 1) * along
    return np.asarray(slopes * radius ** (power - 1) / scale)
