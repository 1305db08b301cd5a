"""Single-track equations of motion on wheels, from torques (docs/equations.md 6). ISO 8855 signs, as in ``body``."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from koopcli.choices import setting
from koopcli.errors import InvalidValueError
from koopcli.records import Channels, FloatArray
from koopcli.vehicles import body, tyre
from koopcli.vehicles.axles import COMBINED_HELP, V_EPS_HELP, Axles, Combined, check_tyres
from koopcli.vehicles.parameters import VehicleParameters
from koopcli.vehicles.plants.plant import PlantChoice


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
    v_eps: float = 0.5
    combined: Combined = "ellipse"
    brake_width: float = 1.0

    states: ClassVar[Channels] = Channels(
        (*body.STATES.names, "wheel_rate_f", "wheel_rate_r"), (*body.STATES.units, "rad/s", "rad/s")
    )
    inputs: ClassVar[Channels] = Channels(
        ("steer_f", "drive_f", "brake_f", "steer_r", "drive_r", "brake_r"), ("rad", "N m", "N m", "rad", "N m", "N m")
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
        dx = body.derivative(self.parameters, x, F_x[..., 0] + F_x[..., 1], F_y, body.like(x, u))
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


@dataclass(frozen=True)
class Wheels(PlantChoice):
    """Wheels with torque and steer as inputs."""

    kind: ClassVar[str] = "wheels"
    states = TorqueInput.states
    inputs = TorqueInput.inputs
    unused = ()
    training, test = "drive", "drive-test"
    first = 1  # as of all plants whose predictors hold the states
    chunk, a_sample = 200_000, 3e-5
    v_eps: float = setting(TorqueInput.v_eps, above=0, high=100, unit="m/s", help=V_EPS_HELP)
    combined: Combined = setting(TorqueInput.combined, option=True, help=COMBINED_HELP)
    brake_width: float = setting(
        TorqueInput.brake_width, above=0, high=1e3, unit="rad/s", help="wheel rate over which brake torques turn"
    )

    def of(self, vehicle: VehicleParameters) -> TorqueInput:
        """The plant of a ``vehicle``. Raises ``InvalidValueError`` for one without tyres or wheels."""
        return TorqueInput(vehicle, self.v_eps, self.combined, self.brake_width)
