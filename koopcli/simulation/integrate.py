"""Batched fixed-step integration: many trajectories at once, one row each."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from koopcli.progress import Progress, silent
from koopcli.records import BoolArray, Course, FloatArray, IntArray

Rhs = Callable[[FloatArray, FloatArray], FloatArray]
Rate = Callable[[FloatArray, FloatArray, float], FloatArray | None]
BATCH = 16384  # trajectories integrated together; rows are independent, so the result does not depend on it
PER_STEP = 2.0  # the fastest rate times the length of a step; Runge-Kutta is stable up to 2.78
MOST_SUBSTEPS = 2**14
LARGEST = 1e15  # of any state: its square still has a place among the numbers
LOST, STIFF = 1, 2  # places in ENDS


def rk4_step(rhs: Rhs, x: FloatArray, u: FloatArray, dt: float | FloatArray) -> FloatArray:
    """One classical Runge-Kutta step of length ``dt``, one for each row if (n, 1), with ``u`` held (2.1)."""
    k1 = rhs(x, u)
    k2 = rhs(x + dt / 2 * k1, u)
    k3 = rhs(x + dt / 2 * k2, u)
    k4 = rhs(x + dt * k3, u)
    return x + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def substeps(rate: FloatArray, dt: float) -> FloatArray:
    """How many steps one sample of each row takes (2.2): the power of two that keeps ``rate`` (n,) in 1/s resolved.

    Where more than ``MOST_SUBSTEPS`` would be needed, it is infinite.
    """
    needed = np.maximum(dt * np.where(np.isnan(rate), 1.0, rate) / PER_STEP, 1.0)
    return np.where(needed > MOST_SUBSTEPS, np.inf, np.exp2(np.ceil(np.log2(needed))))


def simulate(
    rhs: Rhs,
    x0: FloatArray,
    u: FloatArray,
    dt: float,
    progress: Progress = silent,
    fastest_rate: Rate | None = None,
) -> FloatArray:
    """What :func:`integrate` gives, without the course that it took."""
    return integrate(rhs, x0, u, dt, progress, fastest_rate)[0]


def integrate(
    rhs: Rhs,
    x0: FloatArray,
    u: FloatArray,
    dt: float,
    progress: Progress = silent,
    fastest_rate: Rate | None = None,
) -> tuple[FloatArray, Course]:
    """Trajectories (n, steps+1, n_x) from ``x0`` (n, n_x) under ``u`` (n, steps, n_u), and how each went.

    One RK4 step per sample, or as many as ``fastest_rate(x, u, dt)`` (n,) in 1/s asks for, row by row. A trajectory
    that leaves the numbers within ± ``LARGEST``, or would take more than ``MOST_SUBSTEPS`` for one sample, ends there:
    what follows is not a number. ``progress(done, total)`` counts samples.
    """
    n, steps = u.shape[:2]
    x = np.full((n, steps + 1, x0.shape[1]), np.nan)
    x[:, 0] = x0
    course = Course(np.full(n, steps), np.zeros(n, dtype=np.int64), np.ones(n, dtype=np.int64))
    with np.errstate(over="ignore", invalid="ignore"):  # of trajectories that end for it
        _end(course, np.arange(n), LOST, 0, ~_meaningful(x0))
        for start in range(0, n, BATCH):
            rows = np.arange(start, min(start + BATCH, n))
            for k in range(steps):
                going = rows[course.finished[rows]]
                _advance(x, course, going, k, rhs, u, dt, fastest_rate)
                progress(start * steps + len(rows) * (k + 1), n * steps)
    return x, course


def _advance(
    x: FloatArray, course: Course, rows: IntArray, k: int, rhs: Rhs, u: FloatArray, dt: float, rate: Rate | None
) -> None:
    """Take the trajectories ``rows`` from sample k to the next, those that end excepted."""
    rates = rate(x[rows, k], u[rows, k], dt) if rate is not None else None
    if rates is None:
        after = rk4_step(rhs, x[rows, k], u[rows, k], dt)
    else:
        count = substeps(rates, dt)
        _end(course, rows, STIFF, k, np.isinf(count))
        rows, count = rows[np.isfinite(count)], count[np.isfinite(count)]
        course.substeps[rows] = np.maximum(course.substeps[rows], count.astype(np.int64))
        after = _sample(rhs, x[rows, k], u[rows, k], dt, count)
    lost = ~_meaningful(after)
    _end(course, rows, LOST, k, lost)
    x[rows[~lost], k + 1] = after[~lost]


def _meaningful(x: FloatArray) -> BoolArray:
    """Which of ``x`` (n, n_x) are states that can be worked with, (n,)."""
    return np.asarray((np.abs(x) <= LARGEST).all(axis=1))  # what is not a number is not either


def _end(course: Course, rows: IntArray, reason: int, k: int, ended: BoolArray) -> None:
    """Record that those of ``rows`` that have ``ended`` have no state after sample k."""
    course.steps[rows[ended]], course.reason[rows[ended]] = k, reason


def _sample(rhs: Rhs, x: FloatArray, u: FloatArray, dt: float, count: FloatArray) -> FloatArray:
    """The states one sample of ``count`` (n,) steps later.

    The sample is walked through in as many ticks as the stiffest row has steps; a row with half as many steps moves at
    every second tick, and so on, so the rows in motion are always the first so many of those sorted by their steps.
    """
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
