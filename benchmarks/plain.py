"""The order-7 fit as one would first write it: chunked normal equations in plain numpy on the same 516 columns."""

from __future__ import annotations

import numpy as np

CHUNK = 4096


def fit(x: np.ndarray, u: np.ndarray, x_next: np.ndarray, lift) -> tuple[np.ndarray, np.ndarray]:
    """A, B by Σ VᵀV and Σ Vᵀψ(x⁺), V = [ψ(x), u]."""
    gram, cross = 0.0, 0.0
    for start in range(0, len(x), CHUNK):
        rows = slice(start, start + CHUNK)
        V, Y = np.hstack([lift(x[rows]), u[rows]]), lift(x_next[rows])
        gram, cross = gram + V.T @ V, cross + V.T @ Y
    W = np.linalg.solve(gram, cross)
    n_u = u.shape[1]
    return W[:-n_u].T, W[-n_u:].T
