"""Batched fixed-step integration: many trajectories at once, one row each."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from koopcli.progress import Progress, silent
from koopcli.records import FloatArray

Rhs = Callable[[FloatArray, FloatArray], FloatArray]
BATCH = 16384  # trajectories integrated together; rows are independent, so the result does not depend on it


def rk4_step(rhs: Rhs, x: FloatArray, u: FloatArray, dt: float) -> FloatArray:
    """One classical Runge-Kutta step of length ``dt`` with ``u`` held (docs/equations.md 2)."""
    k1 = rhs(x, u)
    k2 = rhs(x + dt / 2 * k1, u)
    k3 = rhs(x + dt / 2 * k2, u)
    k4 = rhs(x + dt * k3, u)
    return x + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def simulate(rhs: Rhs, x0: FloatArray, u: FloatArray, dt: float, progress: Progress = silent) -> FloatArray:
    """Trajectories (n, steps+1, n_x) from ``x0`` (n, n_x) under ``u`` (n, steps, n_u), one RK4 step per sample.

    ``progress(done, total)`` counts trajectories.
    """
    n, steps = u.shape[:2]
    x = np.empty((n, steps + 1, x0.shape[1]))
    x[:, 0] = x0
    for start in range(0, n, BATCH):
        rows = slice(start, min(start + BATCH, n))
        for k in range(steps):
            x[rows, k + 1] = rk4_step(rhs, x[rows, k], u[rows, k], dt)
        progress(rows.stop, n)
    return x
