"""Batched fixed-step integration: many trajectories at once, one row each."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.progress import Progress, silent
from koopcli.records import FloatArray

Rhs = Callable[[FloatArray, FloatArray], FloatArray]
Rate = Callable[[FloatArray, FloatArray, float], FloatArray | None]
BATCH = 16384  # trajectories integrated together; rows are independent, so the result does not depend on it
PER_STEP = 2.0  # the fastest rate times the length of a step; Runge-Kutta is stable up to 2.78
MOST_SUBSTEPS = 2**14


def rk4_step(rhs: Rhs, x: FloatArray, u: FloatArray, dt: float | FloatArray) -> FloatArray:
    """One classical Runge-Kutta step of length ``dt``, one for each row if (n, 1), with ``u`` held (2.1)."""
    k1 = rhs(x, u)
    k2 = rhs(x + dt / 2 * k1, u)
    k3 = rhs(x + dt / 2 * k2, u)
    k4 = rhs(x + dt * k3, u)
    return x + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def substeps(rate: FloatArray, dt: float) -> FloatArray:
    """How many steps one sample of each row takes (2.2): the power of two that keeps ``rate`` (n,) in 1/s resolved.

    Raises ``InvalidValueError`` where that is out of reach.
    """
    needed = np.maximum(dt * np.where(np.isfinite(rate), rate, 1.0) / PER_STEP, 1.0)
    if needed.max(initial=1.0) > MOST_SUBSTEPS:
        raise InvalidValueError(
            f"a sample of {dt:g} s would need {needed.max():,.0f} integration steps (at most {MOST_SUBSTEPS:,}): "
            "lower simulate.dt, or raise simulate.v_eps"
        )
    return np.exp2(np.ceil(np.log2(needed)))


def simulate(
    rhs: Rhs,
    x0: FloatArray,
    u: FloatArray,
    dt: float,
    progress: Progress = silent,
    fastest_rate: Rate | None = None,
) -> FloatArray:
    """Trajectories (n, steps+1, n_x) from ``x0`` (n, n_x) under ``u`` (n, steps, n_u).

    One RK4 step per sample, or as many as ``fastest_rate(x, u, dt)`` (n,) in 1/s asks for, row by row.
    ``progress(done, total)`` counts trajectories.
    """
    n, steps = u.shape[:2]
    x = np.empty((n, steps + 1, x0.shape[1]))
    x[:, 0] = x0
    for start in range(0, n, BATCH):
        rows = slice(start, min(start + BATCH, n))
        for k in range(steps):
            x[rows, k + 1] = _sample(rhs, x[rows, k], u[rows, k], dt, fastest_rate)
            progress(start * steps + (rows.stop - start) * (k + 1), n * steps)
    return x


def _sample(rhs: Rhs, x: FloatArray, u: FloatArray, dt: float, fastest_rate: Rate | None) -> FloatArray:
    """The states one sample later.

    The sample is walked through in as many ticks as the stiffest row has steps; a row with half as many steps moves at
    every second tick, and so on, so the rows in motion are always the first so many of those sorted by their steps.
    """
    rate = fastest_rate(x, u, dt) if fastest_rate is not None else None
    if rate is None:
        return rk4_step(rhs, x, u, dt)
    count = substeps(rate, dt)
    order = np.argsort(-count, kind="stable")
    moving, acting, count = x[order], u[order], count[order]
    ticks = int(count.max(initial=1.0))
    step = dt / count[:, np.newaxis]
    for tick in range(ticks):
        every = tick & -tick if tick else ticks  # the largest power of two that divides the tick
        rows = slice(0, int(np.count_nonzero(count * every >= ticks)))
        moving[rows] = rk4_step(rhs, moving[rows], acting[rows], step[rows])
    after = np.empty_like(x)
    after[order] = moving
    return after
