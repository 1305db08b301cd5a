"""Which axle forces steer and slip can give within a given time: a polygon around them for every instant of a plan."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from koopcli.control.limits import Limits
from koopcli.control.tyres import Tyres
from koopcli.errors import InvalidValueError
from koopcli.records import FloatArray


def directions(count: int) -> FloatArray:
    """``count`` unit vectors (count, 2) at equal angles, the first along x."""
    angle = 2 * np.pi * np.arange(count) / count
    return np.column_stack([np.cos(angle), np.sin(angle)])


@dataclass(frozen=True, eq=False)
class Attainable:
    """The polygons d · v ≤ s for both axles at the instants k = 0 .. ``steps`` - 1 of a plan, ``h`` s apart.

    ``count`` regular directions d, an even number; s is the largest d · F / F_m over a grid of ``points`` = (steer,
    slip) values that |u - u_now| ≤ rate · (k h + h/2 + ``look_ahead`` s) and the bounds allow. Without combined slip
    the force is monotonous in slip within the bounds, so two values of slip do.
    Raises ``InvalidValueError`` for a ``count`` that is odd or below 4, and for fewer than two points a side.
    """

    tyres: Tyres
    limits: Limits
    steps: int
    h: float
    look_ahead: float = 0.1
    count: int = 12
    points: tuple[int, int] = (13, 5)

    def __post_init__(self) -> None:
        if self.count < 4 or self.count % 2:
            raise InvalidValueError(f"'directions' must be even and at least 4, got {self.count}: choose 8, 12 or 16")
        if min(self.points) < 2:
            raise InvalidValueError(f"a grid of {self.points} points has no range: give at least 2 for steer and slip")

    @cached_property
    def rows(self) -> FloatArray:
        """The left sides (steps · 2 · count, 4 · steps): for each instant, the front axle's rows, then the rear's."""
        d, N = directions(self.count), self.steps
        rows = np.zeros((N, 2, self.count, N, 4))
        for k in range(N):
            for axle in (0, 1):
                rows[k, axle, :, k, 2 * axle : 2 * axle + 2] = d
        return rows.reshape(-1, 4 * N)

    def support(self, x: FloatArray, u_now: FloatArray) -> FloatArray:
        """The right sides (steps, 2, count) at the predicted states ``x`` (steps, 3) from the inputs ``u_now`` (4,)."""
        bounds = self.limits.bounds
        low = np.minimum(np.maximum(u_now - self._reach, -bounds), bounds)
        width = np.maximum(np.minimum(u_now + self._reach, bounds), -bounds) - low
        steer = low[:, 0::2, np.newaxis] + width[:, 0::2, np.newaxis] * self._between[0]
        slip = low[:, 1::2, np.newaxis] + width[:, 1::2, np.newaxis] * self._between[1]
        along, across = self.tyres.over(x, self.tyres.grid(steer, slip))
        F = np.stack([along.reshape(self.steps, 2, -1), across.reshape(self.steps, 2, -1)], axis=2)
        seen = np.matmul(self._half, F)  # (steps, 2, count / 2, points)
        return np.concatenate([seen.max(axis=-1), -seen.min(axis=-1)], axis=-1)  # the other directions are opposite

    @cached_property
    def _reach(self) -> FloatArray:
        after = np.arange(self.steps) * self.h + self.h / 2 + self.look_ahead
        return after[:, np.newaxis] * self.limits.rates

    @cached_property
    def _between(self) -> tuple[FloatArray, FloatArray]:
        steer, slip = self.points
        return np.linspace(0, 1, steer), np.linspace(0, 1, slip if self.tyres.combined != "none" else 2)

    @cached_property
    def _half(self) -> FloatArray:
        return directions(self.count)[: self.count // 2]
