"""Both axles of a vehicle on tyres: four wheels in two places (docs/equations.md 6)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.records import FloatArray
from koopcli.vehicles import tyre
from koopcli.vehicles.handling import G, tyres_of, wheel_loads
from koopcli.vehicles.parameters import VehicleParameters
from koopcli.vehicles.tyre import Coefficients

Combined = Literal["none", "ellipse"]
V_EPS_HELP = "a wheel slower than this counts as that fast in its slips"
COMBINED_HELP = "how forces along and across a wheel share its grip"


@dataclass(frozen=True)
class Axles:
    """The tyre forces of a vehicle; every array has the front and the rear axle on its last axis.

    ``v_eps`` in m/s: a wheel slower than this counts as that fast in its slips; ``combined``: one of ``Combined``.
    A tyre with a shift is that of a left wheel, and the right wheel has its mirror image.
    """

    parameters: VehicleParameters
    v_eps: float
    combined: Combined

    @cached_property
    def arms(self) -> FloatArray:
        """Lever arms of the front and the rear axle in m, (2,)."""
        return np.array([self.parameters.l_f, -self.parameters.l_r])

    @cached_property
    def loads(self) -> FloatArray:
        """Static load of one wheel of the front and of the rear axle in N, (2,)."""
        return np.array(wheel_loads(self.parameters))

    @cached_property
    def lateral(self) -> Coefficients:
        """The tyres of both axles in lateral direction."""
        return tyre.stacked(*tyres_of(self.parameters, "lateral"))

    @cached_property
    def longitudinal(self) -> Coefficients:
        """The tyres of both axles in longitudinal direction."""
        return tyre.stacked(*tyres_of(self.parameters, "longitudinal"))

    @cached_property
    def _shifted(self) -> bool:
        """Whether a tyre pulls to one side at no slip angle."""
        return bool(self.lateral.S_h.any())

    @cached_property
    def grip(self) -> FloatArray:
        """Largest force in N of one wheel of each axle in any direction, (2,)."""
        return np.asarray(self.parameters.mu_scale * np.maximum(self.lateral.mu, self.longitudinal.mu) * self.loads)

    def velocities(self, x: FloatArray, steer: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Velocities in m/s at the axles in the frame of their wheels, along and across, (..., 2) each."""
        v_x, v_y = x[..., :1], x[..., 1:2] + self.arms * x[..., 2:3]
        if not steer.any():
            return v_x, v_y
        return np.cos(steer) * v_x + np.sin(steer) * v_y, np.cos(steer) * v_y - np.sin(steer) * v_x

    def forces(self, slip_angle: FloatArray, slip_ratio: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Forces in N of both wheels of each axle together in the frame of the wheels, along and across, (6.3)."""
        both = 2 * self.parameters.mu_scale
        if not self._shifted:
            F_x, F_y = self._left(slip_angle, slip_ratio)
            return both * F_x, both * F_y
        F_x, F_y = self._left(slip_angle, slip_ratio)
        F_x_right, F_y_right = self._left(-slip_angle, slip_ratio)
        return both / 2 * (F_x + F_x_right), both / 2 * (F_y - F_y_right)

    def turned(self, F_x: FloatArray, F_y: FloatArray, steer: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Forces in the frame of wheels at ``steer`` in rad as body-fixed ones, (6.4)."""
        if not steer.any():
            return F_x, F_y
        return np.cos(steer) * F_x - np.sin(steer) * F_y, np.sin(steer) * F_x + np.cos(steer) * F_y

    def slowest(self, x: FloatArray, steer: FloatArray, dt: float) -> tuple[FloatArray, FloatArray]:
        """The lowest speeds in m/s along and across the wheels that ``x`` may come to within ``dt`` s, (..., 2) each.

        An estimate: from how far tyre forces and the turning of the body change them at most.
        """
        p = self.parameters
        force = p.mu_scale * G * max(self.lateral.mu.max(), self.longitudinal.mu.max())  # m/s² at most
        turning = np.abs(x[..., 2]) * (np.abs(x[..., 0]) + np.abs(x[..., 1]))
        spinning = force * np.abs(self.arms) * (p.l_f + p.l_r) * p.m / p.Jzz
        change = dt * (force + spinning + turning[..., np.newaxis])
        w_x, w_y = self.velocities(x, steer)
        return np.maximum(np.abs(w_x) - change, self.v_eps), np.maximum(np.abs(w_y) - change, 0.0)

    def settling_rate(self, along: FloatArray, across: FloatArray) -> FloatArray:
        """How fast tyres at these lowest speeds pull lateral speeds to rest in 1/s, (...,), (6.5)."""
        p = self.parameters
        slope = np.where(along >= across, along / (along**2 + across**2), 0.5 / np.maximum(across, self.v_eps))
        stiffness = 2 * p.mu_scale * tyre.stiffness(self.lateral, self.loads)
        return np.asarray((stiffness * (1 / p.m + self.arms**2 / p.Jzz) * slope).sum(axis=-1))

    def _left(self, slip_angle: FloatArray, slip_ratio: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Forces of the left wheel of each axle on a road of grip one."""
        F_y = tyre.force(self.lateral, slip_angle, self.loads)
        if not slip_ratio.any():
            return slip_ratio, F_y
        F_x = tyre.force(self.longitudinal, slip_ratio, self.loads)
        if self.combined == "none":
            return F_x, F_y
        angle, D_x, D_y = slip_angle + self.lateral.S_h, self.longitudinal.mu * self.loads, self.lateral.mu * self.loads
        return tyre.ellipse(F_x, F_y, slip_ratio, angle, D_x, D_y)


def check_tyres(p: VehicleParameters, plant: str) -> None:
    """Raise ``InvalidValueError`` for a vehicle without the tyres that the ``plant`` needs."""
    if p.lateral is None or p.longitudinal is None:
        raise InvalidValueError(
            f"the plant '{plant}' needs a vehicle with tyres: give the vehicle file the tables [lateral] and "
            "[longitudinal] with B, C, mu and E"
        )
