"""Single-track equations of motion. ISO 8855 signs: x forward, y left, yaw rate positive to the left."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Self

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.records import Channels, FloatArray
from koopcli.vehicles import tyre
from koopcli.vehicles.parameters import MagicFormula, VehicleParameters

G = 9.81  # m/s²
WHEELS_PER_FORCE = {"axle": 1, "wheel": 2}
STATES = Channels(("v_x", "v_y", "yaw_rate"), ("m/s", "m/s", "rad/s"))


def kinetic_energy(parameters: VehicleParameters, x: FloatArray) -> FloatArray:
    """Kinetic energy in J of the states ``x`` (..., 3)."""
    p = parameters
    energy: FloatArray = 0.5 * (p.m * (x[..., 0] ** 2 + x[..., 1] ** 2) + p.Jzz * x[..., 2] ** 2)
    return energy


def wheel_loads(p: VehicleParameters) -> tuple[float, float]:
    """Static load of one wheel of the front and of the rear axle in N."""
    L = p.l_f + p.l_r
    return p.l_r * p.m * G / (2 * L), p.l_f * p.m * G / (2 * L)


def _body(p: VehicleParameters, x: FloatArray, F_x: FloatArray, front: FloatArray, rear: FloatArray) -> FloatArray:
    """dx/dt (..., 3) under the sum of longitudinal forces and the lateral force of each axle in N, (1.1) to (1.3)."""
    v_x, v_y, yaw_rate = x[..., 0], x[..., 1], x[..., 2]
    drag = 0.5 * p.c_w * p.rho * p.A * np.sqrt(v_x**2 + v_y**2)
    dx = np.empty((*np.broadcast_shapes(x.shape[:-1], np.shape(F_x)), 3))
    dx[..., 0] = (F_x - drag * v_x) / p.m + yaw_rate * v_y
    dx[..., 1] = (front + rear - drag * v_y) / p.m - yaw_rate * v_x
    dx[..., 2] = (p.l_f * front - p.l_r * rear) / p.Jzz
    return dx


@dataclass(frozen=True)
class ForceInput:
    """Three states, tyre forces as inputs, air drag (docs/equations.md 1).

    State ``x = [v_x, v_y, yaw_rate]`` in m/s, m/s, rad/s; input ``u = [F_fx, F_fy, F_rx, F_ry]`` in N, the body-fixed
    forces of an axle (``wheels_per_force = 1``) or of each of its two wheels (``wheels_per_force = 2``).
    """

    parameters: VehicleParameters
    wheels_per_force: int = 1

    states: ClassVar[Channels] = STATES
    inputs: ClassVar[Channels] = Channels(("F_fx", "F_fy", "F_rx", "F_ry"), ("N", "N", "N", "N"))

    @classmethod
    def configured(cls, parameters: VehicleParameters, *, force_per: str, v_eps: float) -> Self:
        """The plant with the options that every plant may be given; this one has no use for ``v_eps``."""
        return cls(parameters, WHEELS_PER_FORCE[force_per])

    def rhs(self, x: FloatArray, u: FloatArray) -> FloatArray:
        """Time derivative of ``x`` (..., 3) under ``u`` (..., 4), eqs. (1.1) to (1.3)."""
        n = self.wheels_per_force
        return _body(self.parameters, x, n * (u[..., 0] + u[..., 2]), n * u[..., 1], n * u[..., 3])

    def fastest_rate(self, x: FloatArray, u: FloatArray, dt: float) -> FloatArray | None:
        """Nothing here is stiff: one integration step a sample will do."""
        return None

    def kinetic_energy(self, x: FloatArray) -> FloatArray:
        """Kinetic energy in J of the states ``x`` (..., 3)."""
        return kinetic_energy(self.parameters, x)


@dataclass(frozen=True)
class SlipInput:
    """Three states on tyres, four wheels in two places, air drag (docs/equations.md 6).

    State ``x = [v_x, v_y, yaw_rate]`` in m/s, m/s, rad/s; input ``u = [steer_f, slip_ratio_f, steer_r, slip_ratio_r]``
    in rad and 1: steer angle (positive to the left) and longitudinal slip of both wheels of an axle, zero when the car
    coasts straight ahead. A slip angle counts a wheel slower than ``v_eps`` m/s along itself as that fast.

    Raises ``InvalidValueError`` for a vehicle without tyres.
    """

    parameters: VehicleParameters
    v_eps: float = 0.1

    states: ClassVar[Channels] = STATES
    inputs: ClassVar[Channels] = Channels(
        ("steer_f", "slip_ratio_f", "steer_r", "slip_ratio_r"), ("rad", "1", "rad", "1")
    )

    @classmethod
    def configured(cls, parameters: VehicleParameters, *, force_per: str, v_eps: float) -> Self:
        """The plant with the options that every plant may be given; this one has no use for ``force_per``."""
        return cls(parameters, v_eps)

    def __post_init__(self) -> None:
        if self.parameters.lateral is None or self.parameters.longitudinal is None:
            raise InvalidValueError(
                "the plant 'slips' needs a vehicle with tyres: give the vehicle file the tables [lateral] and "
                "[longitudinal] with B, C, mu and E"
            )

    def rhs(self, x: FloatArray, u: FloatArray) -> FloatArray:
        """Time derivative of ``x`` (..., 3) under ``u`` (..., 4), eqs. (1.1) to (1.3) with (6.1) to (6.4)."""
        both, steer, slip_ratio = 2 * self.parameters.mu_scale, _axles(u, 0), _axles(u, 1)
        w_x, w_y = self._wheel_velocities(x, steer)
        F_y = both * tyre.force(_of(self.parameters.lateral), tyre.slip_angle(w_x, w_y, self.v_eps), self._loads)
        F_x = slip_ratio
        if np.any(slip_ratio):
            F_x = both * tyre.force(_of(self.parameters.longitudinal), slip_ratio, self._loads)
        if np.any(steer):
            F_x, F_y = np.cos(steer) * F_x - np.sin(steer) * F_y, np.sin(steer) * F_x + np.cos(steer) * F_y
        return _body(self.parameters, x, F_x[..., 0] + F_x[..., 1], F_y[..., 0], F_y[..., 1])

    def fastest_rate(self, x: FloatArray, u: FloatArray, dt: float) -> FloatArray:
        """How fast the tyres pull lateral speeds to rest within the next ``dt`` s, (6.5), for ``x`` (..., 3).

        In 1/s, (...,); not more than an estimate, since speeds change in that time.
        """
        p = self.parameters
        grip = p.mu_scale * G * max(_of(p.lateral).mu, _of(p.longitudinal).mu)  # m/s² at most
        turning = np.abs(x[..., 2]) * (np.abs(x[..., 0]) + np.abs(x[..., 1]))
        spinning = grip * np.abs(self._arms) * (p.l_f + p.l_r) * p.m / p.Jzz
        change = dt * (grip + spinning + turning[..., np.newaxis])  # of a wheel's speed
        w_x, w_y = self._wheel_velocities(x, _axles(u, 0))
        along = np.maximum(np.abs(w_x) - change, self.v_eps)
        across = np.maximum(np.abs(w_y) - change, 0.0)
        slope = np.where(along >= across, along / (along**2 + across**2), 0.5 / np.maximum(across, self.v_eps))
        stiffness = 2 * p.mu_scale * tyre.stiffness(_of(p.lateral), self._loads)
        return np.asarray((stiffness * (1 / p.m + self._arms**2 / p.Jzz) * slope).sum(axis=-1))

    def kinetic_energy(self, x: FloatArray) -> FloatArray:
        """Kinetic energy in J of the states ``x`` (..., 3)."""
        return kinetic_energy(self.parameters, x)

    @cached_property
    def _arms(self) -> FloatArray:
        """Lever arms of the front and the rear axle in m, (2,)."""
        return np.array([self.parameters.l_f, -self.parameters.l_r])

    @cached_property
    def _loads(self) -> FloatArray:
        """Static load of one wheel of the front and of the rear axle in N, (2,)."""
        return np.array(wheel_loads(self.parameters))

    def _wheel_velocities(self, x: FloatArray, steer: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Velocities in m/s at the axles in the frame of their wheels, along and across, (..., 2) each."""
        v_x, v_y = x[..., :1], x[..., 1:2] + self._arms * x[..., 2:]
        if not np.any(steer):
            return v_x, v_y
        return np.cos(steer) * v_x + np.sin(steer) * v_y, np.cos(steer) * v_y - np.sin(steer) * v_x


def _axles(u: FloatArray, which: int) -> FloatArray:
    """Steer angle (0) or slip ratio (1) of the front and the rear axle, (..., 2)."""
    return u[..., which::2]


def _of(coefficients: MagicFormula | None) -> MagicFormula:
    assert coefficients is not None, "checked when the plant was made"
    return coefficients
