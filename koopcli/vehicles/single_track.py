"""Single-track equations of motion. ISO 8855 signs: x forward, y left, yaw rate positive to the left."""

from __future__ import annotations

from dataclasses import dataclass
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
        (front_x, front_y), (rear_x, rear_y) = (self._axle_force(x, *axle) for axle in self._axles(u))
        return _body(self.parameters, x, front_x + rear_x, front_y, rear_y)

    def fastest_rate(self, x: FloatArray, u: FloatArray, dt: float) -> FloatArray:
        """How fast the tyres pull lateral speeds to rest within the next ``dt`` s, (6.5), for ``x`` (..., 3).

        In 1/s, (...,); not more than an estimate, since speeds change in that time.
        """
        p = self.parameters
        grip = p.mu_scale * max(_of(p.lateral).mu, _of(p.longitudinal).mu)
        turn = np.abs(x[..., 2])
        change = dt * (grip * G + turn * (np.abs(x[..., 0]) + np.abs(x[..., 1])))
        fastest = np.zeros(x.shape[:-1])
        for arm, load, steer, _ in self._axles(u):
            v_x, v_y = self._wheel_velocity(x, arm, steer)
            turning = change + dt * grip * G * abs(arm) * (p.l_f + p.l_r) * p.m / p.Jzz
            along = np.maximum(np.abs(v_x) - turning, self.v_eps)
            across = np.maximum(np.abs(v_y) - turning, 0.0)
            slope = np.where(along >= across, along / (along**2 + across**2), 0.5 / np.maximum(across, self.v_eps))
            fastest += 2 * p.mu_scale * tyre.stiffness(_of(p.lateral), load) * (1 / p.m + arm**2 / p.Jzz) * slope
        return fastest

    def kinetic_energy(self, x: FloatArray) -> FloatArray:
        """Kinetic energy in J of the states ``x`` (..., 3)."""
        return kinetic_energy(self.parameters, x)

    def _axles(self, u: FloatArray) -> tuple[tuple[float, float, FloatArray, FloatArray], ...]:
        """Front and rear: lever arm in m, static load of one wheel in N, steer and slip ratio."""
        p = self.parameters
        per_metre = p.m * G / (2 * (p.l_f + p.l_r))
        return (
            (p.l_f, per_metre * p.l_r, u[..., 0], u[..., 1]),
            (-p.l_r, per_metre * p.l_f, u[..., 2], u[..., 3]),
        )

    def _wheel_velocity(self, x: FloatArray, arm: float, steer: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Velocity in m/s at the axle, in the frame of its wheels."""
        v_x, v_y = x[..., 0], x[..., 1] + arm * x[..., 2]
        if not np.any(steer):
            return v_x, v_y
        return np.cos(steer) * v_x + np.sin(steer) * v_y, np.cos(steer) * v_y - np.sin(steer) * v_x

    def _axle_force(
        self, x: FloatArray, arm: float, load: float, steer: FloatArray, slip_ratio: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Force of both wheels of an axle in N, in body axes."""
        p = self.parameters
        both = 2 * p.mu_scale
        v_x, v_y = self._wheel_velocity(x, arm, steer)
        F_x = (
            both * tyre.force(_of(p.longitudinal), slip_ratio, load)
            if np.any(slip_ratio)
            else np.zeros_like(slip_ratio)
        )
        F_y = both * tyre.force(_of(p.lateral), tyre.slip_angle(v_x, v_y, self.v_eps), load)
        if not np.any(steer):
            return F_x, F_y
        return np.cos(steer) * F_x - np.sin(steer) * F_y, np.sin(steer) * F_x + np.cos(steer) * F_y


def _of(coefficients: MagicFormula | None) -> MagicFormula:
    assert coefficients is not None, "checked when the plant was made"
    return coefficients
