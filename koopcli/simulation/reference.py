"""Integration by a solver that controls its error, one trajectory at a time: to compare with, slow."""

from __future__ import annotations

import warnings

import numpy as np

from koopcli.progress import Progress, silent
from koopcli.records import Course, FloatArray, Trajectories
from koopcli.simulation.integrate import LARGEST, LOST, Rhs

RELATIVE, ABSOLUTE = 1e-10, 1e-12  # tolerances
FAILED = 3  # place in ENDS
MOST_CALLS = 200_000  # of the right-hand side for one sample


def reference(
    rhs: Rhs, x0: FloatArray, u: FloatArray, dt: float, progress: Progress = silent
) -> tuple[FloatArray, Course]:
    """What :func:`koopcli.simulation.integrate.integrate` approximates, by LSODA, which changes between a method for
    stiff and one for other equations; it starts afresh at every sample, where inputs jump.

    Shapes as there. ``progress(done, total)`` counts samples.
    """
    n, steps = u.shape[:2]
    x = np.full((n, steps + 1, x0.shape[1]), np.nan)
    x[:, 0] = x0
    course = Course(np.full(n, steps), np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.int64))
    for i in range(n):
        for k in range(steps):
            after, failed = _sample(rhs, x[i, k], u[i, k], dt)
            if failed:
                course.steps[i], course.reason[i] = k, failed
                break
            x[i, k + 1] = after
        progress((i + 1) * steps, n * steps)
    return x, course


def difference(usual: Trajectories, other: Trajectories) -> list[tuple[str, str, float, float]]:
    """How far two simulations of one sample are apart, where both have states: name and unit of each state, the
    largest absolute difference and the root of the mean square.
    """
    apart = np.asarray(usual.x[:]) - np.asarray(other.x[:])
    apart = apart[np.isfinite(apart).all(axis=2)]
    largest, root = np.abs(apart).max(axis=0), np.sqrt((apart**2).mean(axis=0))
    channels = usual.state_channels
    return list(zip(channels.names, channels.units, largest.tolist(), root.tolist(), strict=True))


class _StuckError(Exception):
    """The solver makes no headway, as where a solution reaches infinity: it would go on for ever."""


def _sample(rhs: Rhs, x: FloatArray, u: FloatArray, dt: float) -> tuple[FloatArray, int]:
    """The state one sample later, and why there is none."""
    if not (np.abs(x) <= LARGEST).all():
        return x, LOST
    calls = 0

    def counted(t: float, y: FloatArray) -> FloatArray:
        nonlocal calls
        calls += 1
        if calls > MOST_CALLS:
            raise _StuckError
        return rhs(y, u)

    from scipy.integrate import solve_ivp  # noqa: PLC0415  (half a second that only this solver needs)

    try:
        with np.errstate(over="ignore", invalid="ignore"), warnings.catch_warnings():  # of one that ends for it
            warnings.simplefilter("ignore")
            solution = solve_ivp(counted, (0.0, dt), x, method="LSODA", rtol=RELATIVE, atol=ABSOLUTE)
    except _StuckError:
        return x, FAILED
    after: FloatArray = solution.y[:, -1]
    if not solution.success:
        return after, FAILED
    return after, 0 if (np.abs(after) <= LARGEST).all() else LOST
