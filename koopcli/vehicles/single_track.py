"""Single-track equations of motion, from tyre forces, slips or wheel torques. ISO 8855 signs, as in ``body``."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Self

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.records import Channels, FloatArray
from koopcli.vehicles import body, tyre
from koopcli.vehicles.axles import Axles, check_tyres
from koopcli.vehicles.options import CUSTOMARY, Options
from koopcli.vehicles.parameters import VehicleParameters

WHEELS_PER_FORCE = {"axle": 1, "wheel": 2}
OF_SLIPS, OF_WHEELS = CUSTOMARY["slips"], CUSTOMARY["wheels"]


@dataclass(frozen=True)
class ForceInput:
    """Three states, tyre forces as inputs, air drag (docs/equations.md 1).

    State ``x = [v_x, v_y, yaw_rate]`` in m/s, m/s, rad/s; input ``u = [F_fx, F_fy, F_rx, F_ry]`` in N, the body-fixed
    forces of an axle (``wheels_per_force = 1``) or of each of its two wheels (``wheels_per_force = 2``).
    """

    parameters: VehicleParameters
    wheels_per_force: int = 1

    states: ClassVar[Channels] = body.STATES
    inputs: ClassVar[Channels] = Channels(("F_fx", "F_fy", "F_rx", "F_ry"), ("N", "N", "N", "N"))

    @classmethod
    def configured(cls, parameters: VehicleParameters, options: Options) -> Self:
        """The plant of a vehicle with the ``options`` that it has a use for."""
        return cls(parameters, WHEELS_PER_FORCE[options.force_per])

    def rhs(self, x: FloatArray, u: FloatArray) -> FloatArray:
        """Time derivative of ``x`` (..., 3) under ``u`` (..., 4), eqs. (1.1) to (1.3)."""
        forces = self.wheels_per_force * u
        return body.derivative(self.parameters, x, forces[..., 0] + forces[..., 2], forces[..., 1::2], _like(x, u))

    def fastest_rate(self, x: FloatArray, u: FloatArray, dt: float) -> FloatArray | None:
        """Nothing here is stiff: one integration step a sample will do."""
        return None

    def kinetic_energy(self, x: FloatArray) -> FloatArray:
        """Kinetic energy in J of the states ``x`` (..., 3)."""
        return body.kinetic_energy(self.parameters, x)


@dataclass(frozen=True)
class SlipInput:
    """Three states on tyres, four wheels in two places, air drag (docs/equations.md 6).

    State ``x = [v_x, v_y, yaw_rate]`` in m/s, m/s, rad/s; input ``u = [steer_f, slip_ratio_f, steer_r, slip_ratio_r]``
    in rad and 1: steer angle (positive to the left) and longitudinal slip of both wheels of an axle, zero when the car
    coasts straight ahead. A slip angle counts a wheel slower than ``v_eps`` m/s along itself as that fast; ``combined``
    says how forces along and across a wheel share its grip.

    Raises ``InvalidValueError`` for a vehicle without tyres.
    """

    parameters: VehicleParameters
    v_eps: float = OF_SLIPS["v_eps"]
    combined: str = OF_SLIPS["combined"]

    states: ClassVar[Channels] = body.STATES
    inputs: ClassVar[Channels] = Channels(
        ("steer_f", "slip_ratio_f", "steer_r", "slip_ratio_r"), ("rad", "1", "rad", "1")
    )

    @classmethod
    def configured(cls, parameters: VehicleParameters, options: Options) -> Self:
        """The plant of a vehicle with the ``options`` that it has a use for."""
        return cls(parameters, options.v_eps or cls.v_eps, options.combined or cls.combined)

    def __post_init__(self) -> None:
        check_tyres(self.parameters, "slips")

    def rhs(self, x: FloatArray, u: FloatArray) -> FloatArray:
        """Time derivative of ``x`` (..., 3) under ``u`` (..., 4), eqs. (1.1) to (1.3) with (6.1) to (6.4)."""
        axles, steer, slip_ratio = self._axles, u[..., 0::2], u[..., 1::2]
        w_x, w_y = axles.velocities(x, steer)
        F_x, F_y = axles.turned(*axles.forces(tyre.slip_angle(w_x, w_y, self.v_eps), slip_ratio), steer)
        return body.derivative(self.parameters, x, F_x[..., 0] + F_x[..., 1], F_y, _like(x, u))

    def fastest_rate(self, x: FloatArray, u: FloatArray, dt: float) -> FloatArray:
        """How fast the tyres pull lateral speeds to rest within the next ``dt`` s, (6.5), for ``x`` (..., 3).

        In 1/s, (...,); not more than an estimate, since speeds change in that time.
        """
        return self._axles.settling_rate(*self._axles.slowest(x, u[..., 0::2], dt))

    def kinetic_energy(self, x: FloatArray) -> FloatArray:
        """Kinetic energy in J of the states ``x`` (..., 3)."""
        return body.kinetic_energy(self.parameters, x)

    @cached_property
    def _axles(self) -> Axles:
        return Axles(self.parameters, self.v_eps, self.combined)


@dataclass(frozen=True)
class TorqueInput:
    """Five states with wheel dynamics, four wheels in two places, air drag (docs/equations.md 6).

    State ``x = [v_x, v_y, yaw_rate, wheel_rate_f, wheel_rate_r]`` in m/s, m/s, rad/s: the last two turn positive when
    the car rolls forward. Input ``u = [steer_f, drive_f, brake_f, steer_r, drive_r, brake_r]`` in rad and N m: steer
    angle of an axle (positive to the left), drive and brake torque of each of its two wheels. ``v_eps``, ``combined``
    and ``brake_width`` as in ``Options``.

    Raises ``InvalidValueError`` for a vehicle without tyres or wheels.
    """

    parameters: VehicleParameters
    v_eps: float = OF_WHEELS["v_eps"]
    combined: str = OF_WHEELS["combined"]
    brake_width: float = OF_WHEELS["brake_width"]

    states: ClassVar[Channels] = Channels(
        (*body.STATES.names, "wheel_rate_f", "wheel_rate_r"), (*body.STATES.units, "rad/s", "rad/s")
    )
    inputs: ClassVar[Channels] = Channels(
        ("steer_f", "drive_f", "brake_f", "steer_r", "drive_r", "brake_r"), ("rad", "N m", "N m", "rad", "N m", "N m")
    )

    @classmethod
    def configured(cls, parameters: VehicleParameters, options: Options) -> Self:
        """The plant of a vehicle with the ``options`` that it has a use for."""
        return cls(
            parameters,
            options.v_eps or cls.v_eps,
            options.combined or cls.combined,
            options.brake_width or cls.brake_width,
        )

    def __post_init__(self) -> None:
        check_tyres(self.parameters, "wheels")
        if self.parameters.J_R is None or self.parameters.r_w is None:
            raise InvalidValueError(
                "the plant 'wheels' needs a vehicle with wheels: give the vehicle file their inertia J_R and radius r_w"
            )

    def rhs(self, x: FloatArray, u: FloatArray) -> FloatArray:
        """Time derivative of ``x`` (..., 5) under ``u`` (..., 6), eqs. (1.1) to (1.3) with (6.1) to (6.9)."""
        axles, (r_w, J_R) = self._axles, self._wheel
        steer, drive, brake = u[..., 0::3], u[..., 1::3], u[..., 2::3]
        rates = x[..., 3:]
        w_x, w_y = axles.velocities(x, steer)
        slip_ratio = tyre.slip_ratio(r_w * rates, w_x, self.v_eps)
        along, across = axles.forces(tyre.slip_angle(w_x, w_y, self.v_eps), slip_ratio)
        F_x, F_y = axles.turned(along, across, steer)
        dx = body.derivative(self.parameters, x, F_x[..., 0] + F_x[..., 1], F_y, _like(x, u))
        dx[..., 3:] = (drive - brake * np.tanh(rates / self.brake_width) - r_w / 2 * along) / J_R
        return dx

    def fastest_rate(self, x: FloatArray, u: FloatArray, dt: float) -> FloatArray:
        """How fast wheels come to roll, or lateral speeds to rest, within the next ``dt`` s, (6.5) and (6.10).

        In 1/s, (...,), for ``x`` (..., 5) under ``u`` (..., 6); not more than an estimate, since speeds change in that
        time.
        """
        axles, (r_w, J_R) = self._axles, self._wheel
        along, across = axles.slowest(x, u[..., 0::3], dt)
        drive, brake, rates = u[..., 1::3], u[..., 2::3], np.abs(x[..., 3:])
        slowest = np.maximum(rates - dt / J_R * (np.abs(drive) + np.abs(brake) + r_w * axles.grip), 0.0)
        stiffness = self.parameters.mu_scale * tyre.stiffness(axles.longitudinal, axles.loads)
        slope = stiffness / np.maximum(along, r_w * slowest)
        braking = np.abs(brake) / self.brake_width / np.cosh(np.minimum(slowest / self.brake_width, 300.0)) ** 2
        rolling = (r_w**2 * slope + braking) / J_R
        return np.asarray(np.maximum(axles.settling_rate(along, across), rolling.max(axis=-1)))

    def kinetic_energy(self, x: FloatArray) -> FloatArray:
        """Kinetic energy in J of the states ``x`` (..., 5), of the body and of four wheels about their axes."""
        spin: FloatArray = self._wheel[1] * (x[..., 3:] ** 2).sum(axis=-1)
        return np.asarray(body.kinetic_energy(self.parameters, x) + spin)

    @cached_property
    def _axles(self) -> Axles:
        return Axles(self.parameters, self.v_eps, self.combined)

    @property
    def _wheel(self) -> tuple[float, float]:
        """Radius in m and inertia in kg m² of a wheel."""
        p = self.parameters
        assert p.r_w is not None, "checked when the plant was made"
        assert p.J_R is not None, "checked when the plant was made"
        return p.r_w, p.J_R


def _like(x: FloatArray, u: FloatArray) -> FloatArray:
    """An array for the derivative of ``x`` under ``u``."""
    return np.empty((*np.broadcast_shapes(x.shape[:-1], u.shape[:-1]), x.shape[-1]))
