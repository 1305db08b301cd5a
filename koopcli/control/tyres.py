"""Axle forces as a controller knows them, divided by the largest force of each axle.

They are those of ``koopcli.vehicles.axles`` with the same tyres, arranged for one car at a time: a force depends on
steer and on slip through one function each, so a grid of both costs as many evaluations as its two sides have points.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.records import FloatArray
from koopcli.vehicles import tyre
from koopcli.vehicles.axles import Axles, Combined, check_tyres
from koopcli.vehicles.handling import tyres_of
from koopcli.vehicles.parameters import VehicleParameters

FRONT, REAR = 0, 1


class Formula(NamedTuple):
    """A magic formula whose peak ``D`` is in units of F_m; arrays (2, 1) of both axles, or numbers of one."""

    B: FloatArray
    C: FloatArray
    D: FloatArray
    E: FloatArray

    def __call__(self, slip: FloatArray) -> FloatArray:
        """Force at ``slip`` (..., 2, points)."""
        Bx = self.B * slip
        return np.asarray(self.D * np.sin(self.C * np.arctan(Bx - self.E * (Bx - np.arctan(Bx)))))


class Single(NamedTuple):
    """The same for one axle, in plain numbers."""

    B: float
    C: float
    D: float
    E: float

    def __call__(self, slip: float) -> float:
        """Force at ``slip``."""
        Bx = self.B * slip
        return self.D * math.sin(self.C * math.atan(Bx - self.E * (Bx - math.atan(Bx))))


class Grid(NamedTuple):
    """Steer (..., 2, s) and slip (..., 2, k) with what of the forces depends on each alone."""

    steer: FloatArray
    slip: FloatArray
    cos: FloatArray
    sin: FloatArray
    along: FloatArray  # the pure longitudinal force / F_m


@dataclass(frozen=True, eq=False)
class Tyres:
    """The axles of a vehicle; ``combined`` and ``v_eps`` in m/s as the plant ``slips`` has them.

    Forces are of both wheels of an axle, body-fixed, and in units of F_m = 2 mu_scale max(mu_x, mu_y) F_z of the axle.
    Raises ``InvalidValueError`` for a vehicle without tyres or without grip.
    """

    parameters: VehicleParameters
    combined: Combined = "ellipse"
    v_eps: float = 1.0

    def __post_init__(self) -> None:
        check_tyres(self.parameters, "slips")
        if not (self.largest > 0).all():
            raise InvalidValueError(
                "the vehicle has no grip (mu or mu_scale is 0), so no controller can move it: give it some"
            )

    @cached_property
    def axles(self) -> Axles:
        """The same axles as the plants have them."""
        return Axles(self.parameters, self.v_eps, self.combined)

    @cached_property
    def largest(self) -> FloatArray:
        """F_m of the front and of the rear axle in N, (2,)."""
        return 2 * self.axles.grip

    @cached_property
    def scale(self) -> FloatArray:
        """F_m of each of [F_fx, F_fy, F_rx, F_ry] in N, (4,)."""
        return np.repeat(self.largest, 2)

    @cached_property
    def arms(self) -> tuple[float, float]:
        """Lever arms of both axles in m."""
        return float(self.axles.arms[FRONT]), float(self.axles.arms[REAR])

    @cached_property
    def body_matrix(self) -> FloatArray:
        """G (3, 4): what axle forces in N add to the time derivatives of v_x, v_y and yaw rate."""
        p = self.parameters
        rows = [[1 / p.m, 0, 1 / p.m, 0], [0, 1 / p.m, 0, 1 / p.m], [0, p.l_f / p.Jzz, 0, -p.l_r / p.Jzz]]
        return np.array(rows)

    def forces(self, x: FloatArray, u: FloatArray) -> FloatArray:
        """[F_fx, F_fy, F_rx, F_ry] / F_m (..., 4) at ``x`` (..., 3) under ``u`` (..., 4), as the plants have them."""
        steer, slip = u[..., 0::2], u[..., 1::2]
        w_x, w_y = self.axles.velocities(x, steer)
        F = self.axles.turned(*self.axles.forces(tyre.slip_angle(w_x, w_y, self.v_eps), slip), steer)
        return np.stack(np.broadcast_arrays(*F), axis=-1).reshape(*np.shape(F[1])[:-1], 4) / self.scale

    def grid(self, steer: FloatArray, slip: FloatArray) -> Grid:
        """What a grid of ``steer`` (..., 2, s) in rad and ``slip`` (..., 2, k) needs at any state."""
        return Grid(steer, slip, np.cos(steer), np.sin(steer), self._longitudinal(slip))

    def over(self, x: FloatArray, grid: Grid) -> tuple[FloatArray, FloatArray]:
        """Forces / F_m along and across the body, (..., 2, s, k) each, at ``x`` (..., 3) over a ``grid``."""
        v_x = x[..., 0, np.newaxis, np.newaxis]
        v_y = (x[..., 1, np.newaxis] + x[..., 2, np.newaxis] * self.axles.arms)[..., np.newaxis]
        w_x, w_y = grid.cos * v_x + grid.sin * v_y, grid.cos * v_y - grid.sin * v_x
        angle = -np.arctan2(w_y, np.maximum(np.abs(w_x), self.v_eps))
        F_x, F_y = self._left(angle, grid)
        if self._shifted:
            right_x, right_y = self._left(-angle, grid)
            F_x, F_y = (F_x + right_x) / 2, (F_y - right_y) / 2
        c, s = grid.cos[..., np.newaxis], grid.sin[..., np.newaxis]
        return c * F_x - s * F_y, s * F_x + c * F_y

    def of_axle(self, axle: int, v_x: float, v_y: float, steer: float, slip: float) -> tuple[float, float]:
        """Force / F_m of one axle, whose centre moves at ``v_x`` and ``v_y`` m/s in body axes, in plain numbers."""
        c, s = math.cos(steer), math.sin(steer)
        w_x, w_y = c * v_x + s * v_y, c * v_y - s * v_x
        angle = -math.atan2(w_y, max(abs(w_x), self.v_eps))
        F_x, F_y = self._left_of_axle(axle, angle, slip)
        if self._shifted:
            right_x, right_y = self._left_of_axle(axle, -angle, slip)
            F_x, F_y = (F_x + right_x) / 2, (F_y - right_y) / 2
        return c * F_x - s * F_y, s * F_x + c * F_y

    def at(self, x: FloatArray, u: FloatArray) -> FloatArray:
        """Forces / F_m (4,) at one state (3,) under inputs (4,): as :meth:`forces`, faster for one car."""
        v_x, v_y, yaw_rate = x.tolist()
        front, rear = (
            self.of_axle(i, v_x, v_y + self.arms[i] * yaw_rate, float(u[2 * i]), float(u[2 * i + 1]))
            for i in (FRONT, REAR)
        )
        return np.array([*front, *rear])

    def _left(self, angle: FloatArray, grid: Grid) -> tuple[FloatArray, FloatArray]:
        """Both wheels taken for left ones, in the frame of the wheels, (..., 2, s, k)."""
        angle = angle + self._shift
        pure = self._lateral(angle)
        if self.combined == "none":
            return grid.along[..., np.newaxis, :], pure[..., np.newaxis]
        across = np.sin(angle)
        D_x, D_y = self._longitudinal.D, self._lateral.D
        along = grid.along[..., np.newaxis, :]
        F_x = along * _share((D_y * grid.slip)[..., np.newaxis, :], along * across[..., np.newaxis])
        side = pure[..., np.newaxis]
        F_y = side * _share((D_x * across)[..., np.newaxis], side * grid.slip[..., np.newaxis, :])
        return F_x, F_y

    def _left_of_axle(self, axle: int, angle: float, slip: float) -> tuple[float, float]:
        lateral, longitudinal, shift = self._single[axle]
        angle += shift
        F_y = lateral(angle)
        if slip == 0.0:
            return 0.0, F_y
        F_x = longitudinal(slip)
        if self.combined == "none":
            return F_x, F_y
        across = math.sin(angle)
        part = abs(lateral.D * slip)
        side = abs(longitudinal.D * across)
        F = F_x * part / math.hypot(part, F_x * across)
        whole = math.hypot(side, F_y * slip)
        return F, F_y * side / whole if whole > 0.0 else 0.0

    @cached_property
    def _shifted(self) -> bool:
        return bool(self.axles.lateral.S_h.any())

    @cached_property
    def _shift(self) -> FloatArray:
        return self.axles.lateral.S_h[:, np.newaxis]

    @cached_property
    def _lateral(self) -> Formula:
        return self._formula(self.axles.lateral)

    @cached_property
    def _longitudinal(self) -> Formula:
        return self._formula(self.axles.longitudinal)

    def _formula(self, c: tyre.Coefficients) -> Formula:
        D = 2 * self.parameters.mu_scale * c.mu * self.axles.loads / self.largest
        return Formula(*(values[:, np.newaxis] for values in (c.B, c.C, D, c.E)))

    @cached_property
    def _single(self) -> tuple[tuple[Single, Single, float], ...]:
        """The lateral and longitudinal tyre of each axle, and its shift."""
        shifts = [t.S_h for t in tyres_of(self.parameters, "lateral")]
        return tuple(
            (
                Single(*(float(values[i, 0]) for values in self._lateral)),
                Single(*(float(values[i, 0]) for values in self._longitudinal)),
                shifts[i],
            )
            for i in (FRONT, REAR)
        )


def _share(part: FloatArray, rest: FloatArray) -> FloatArray:
    """|part| / √(part² + rest²), nearly zero where both are."""
    square = part * part
    return np.asarray(np.sqrt(square / (square + rest * rest + 1e-300)))
