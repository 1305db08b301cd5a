"""Steer and slip whose axle forces come nearest to those of a plan."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from koopcli.control.limits import SLIP, STEER, Limits
from koopcli.control.tyres import Grid, Tyres
from koopcli.errors import InvalidValueError
from koopcli.records import FloatArray

STEER_WEIGHT = 1e-3  # of ((steer - steer now) / STEER)²
SLIP_WEIGHT = 2e-3  # of (slip / SLIP)²
DAMPING = 1e-3  # added to the diagonal of Gauss and Newton
DIFFERENCE = 1e-4  # rad and 1
REFINEMENTS = 2


@dataclass(frozen=True, eq=False)
class Inverse:
    """The inverse of the tyres: per axle the steer and slip within the bounds that minimise

    |F(x, u) - F_wanted|² / F_m² + 1e-3 ((steer - steer_now) / 0.6)² + 2e-3 (slip / 0.15)²,

    first over a grid of ``points`` = (steer, slip) values, then by two damped steps of Gauss and Newton, each of which
    is kept only if it is better. Rates do not bound the search: clipped afterwards, they only delay what it found.
    Raises ``InvalidValueError`` for fewer than two points a side.
    """

    tyres: Tyres
    limits: Limits
    points: tuple[int, int] = (25, 13)

    def __post_init__(self) -> None:
        if min(self.points) < 2:
            raise InvalidValueError(f"a grid of {self.points} points has no range: give at least 2 for steer and slip")

    def __call__(self, x: FloatArray, u_now: FloatArray, wanted: FloatArray) -> FloatArray:
        """Inputs (4,) within the bounds, at ``x`` (3,) from ``u_now`` (4,), for the forces ``wanted`` / F_m (4,)."""
        grid = self._grid
        along, across = self.tyres.over(x, grid)
        along -= wanted[0::2, np.newaxis, np.newaxis]
        across -= wanted[1::2, np.newaxis, np.newaxis]
        turning = (STEER_WEIGHT / STEER**2) * (grid.steer - u_now[0::2, np.newaxis]) ** 2
        cost = along * along + across * across + turning[..., np.newaxis] + self._slip_cost
        best = cost.reshape(2, -1).argmin(axis=1)
        slips = grid.slip.shape[-1]
        v_x, v_y, yaw_rate = x.tolist()
        inputs = np.empty(4)
        for axle in (0, 1):
            steer, slip = divmod(int(best[axle]), slips)
            start = float(grid.steer[axle, steer]), float(grid.slip[axle, slip])
            at = v_x, v_y + self.tyres.arms[axle] * yaw_rate
            inputs[2 * axle : 2 * axle + 2] = self._refined(axle, at, start, float(u_now[2 * axle]), wanted)
        return inputs

    def _refined(
        self, axle: int, at: tuple[float, float], start: tuple[float, float], now: float, wanted: FloatArray
    ) -> tuple[float, float]:
        """Steer and slip of one axle, whose centre moves ``at`` m/s, after the steps of Gauss and Newton."""
        steer, slip = start
        most_steer, most_slip = float(self.limits.bounds[2 * axle]), float(self.limits.bounds[2 * axle + 1])
        F_x, F_y = float(wanted[2 * axle]), float(wanted[2 * axle + 1])
        a, b = math.sqrt(STEER_WEIGHT) / STEER, math.sqrt(SLIP_WEIGHT) / SLIP
        force = self.tyres.of_axle
        f = force(axle, *at, steer, slip)
        for _ in range(REFINEMENTS):
            r = f[0] - F_x, f[1] - F_y, a * (steer - now), b * slip
            g, q = force(axle, *at, steer + DIFFERENCE, slip), force(axle, *at, steer, slip + DIFFERENCE)
            s0, s1 = (g[0] - f[0]) / DIFFERENCE, (g[1] - f[1]) / DIFFERENCE
            k0, k1 = (q[0] - f[0]) / DIFFERENCE, (q[1] - f[1]) / DIFFERENCE
            H11, H22, H12 = s0 * s0 + s1 * s1 + a * a + DAMPING, k0 * k0 + k1 * k1 + b * b + DAMPING, s0 * k0 + s1 * k1
            g1, g2 = s0 * r[0] + s1 * r[1] + a * r[2], k0 * r[0] + k1 * r[1] + b * r[3]
            det = H11 * H22 - H12 * H12
            new_steer = min(max(steer - (H22 * g1 - H12 * g2) / det, -most_steer), most_steer)
            new_slip = min(max(slip - (H11 * g2 - H12 * g1) / det, -most_slip), most_slip)
            f_new = force(axle, *at, new_steer, new_slip)
            new = (f_new[0] - F_x, f_new[1] - F_y, a * (new_steer - now), b * new_slip)
            if math.hypot(*new) >= math.hypot(*r):
                break
            steer, slip, f = new_steer, new_slip, f_new
        return steer, slip

    @cached_property
    def _grid(self) -> Grid:
        bounds = self.limits.bounds[:, np.newaxis]
        steer, slip = (np.linspace(-1, 1, count) for count in self.points)
        return self.tyres.grid(bounds[0::2] * steer, bounds[1::2] * slip)

    @cached_property
    def _slip_cost(self) -> FloatArray:
        return (SLIP_WEIGHT * (self._grid.slip / SLIP) ** 2)[:, np.newaxis]
