"""What a run is worth: settle time, cost and, where it follows a road, its errors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from koopcli.control.control import TS
from koopcli.control.controllers.controller import RECOVERY
from koopcli.records import FloatArray

SETTLED = (1.0, 0.5, 0.1)  # m/s, m/s, rad/s around the reference


def settle_time(x: FloatArray, reference: FloatArray) -> float:
    """The first time in s after which ``x`` (k + 1, 3) keeps near the ``reference`` (k + 1, 3) to the end of the run.

    Infinite where it does not.
    """
    away = np.flatnonzero((np.abs(x - reference) > SETTLED).any(axis=1))
    if not len(away):
        return 0.0
    return float(np.inf if away[-1] == len(x) - 1 else (away[-1] + 1) * TS)


def cost(x: FloatArray, reference: FloatArray) -> float:
    """J: the sum over k ≥ 1 of squared errors by the weights of recoveries, times ``TS``; (k + 1, 3) both."""
    return float(TS * ((x[1:] - reference[1:]) ** 2 * RECOVERY).sum())


@dataclass(frozen=True)
class Tracking:
    """Root mean square errors of ``yaw_rate`` in rad/s and ``v_y`` in m/s, and the largest lateral ``offset`` in m."""

    yaw_rate: float
    v_y: float
    offset: float


def tracking(x: FloatArray, reference: FloatArray) -> Tracking:
    """How closely ``x`` (k + 1, 3) follows the ``reference`` (k + 1, 3), from the same place and heading."""
    error = x - reference
    rms = np.sqrt((error**2).mean(axis=0))
    offset = float(np.abs(_lateral(x) - _lateral(reference)).max())
    return Tracking(float(rms[2]), float(rms[1]), offset)


def _lateral(x: FloatArray) -> FloatArray:
    """How far to the left of the first heading a car has come, (k + 1,)."""
    heading = TS * np.cumsum(x[:, 2])
    return np.asarray(TS * np.cumsum(x[:, 0] * np.sin(heading) + x[:, 1] * np.cos(heading)))
