"""Single-track equations of motion on tyres, from slips (docs/equations.md 6). ISO 8855 signs, as in ``body``."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

from koopcli.choices import setting
from koopcli.records import Channels, FloatArray
from koopcli.vehicles import body, tyre
from koopcli.vehicles.axles import COMBINED_HELP, V_EPS_HELP, Axles, Combined, check_tyres
from koopcli.vehicles.parameters import VehicleParameters
from koopcli.vehicles.plants.plant import PlantChoice


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
    v_eps: float = 0.1
    combined: Combined = "none"

    states: ClassVar[Channels] = body.STATES
    inputs: ClassVar[Channels] = Channels(
        ("steer_f", "slip_ratio_f", "steer_r", "slip_ratio_r"), ("rad", "1", "rad", "1")
    )

    def __post_init__(self) -> None:
        check_tyres(self.parameters, "slips")

    def rhs(self, x: FloatArray, u: FloatArray) -> FloatArray:
        """Time derivative of ``x`` (..., 3) under ``u`` (..., 4), eqs. (1.1) to (1.3) with (6.1) to (6.4)."""
        axles, steer, slip_ratio = self._axles, u[..., 0::2], u[..., 1::2]
        w_x, w_y = axles.velocities(x, steer)
        F_x, F_y = axles.turned(*axles.forces(tyre.slip_angle(w_x, w_y, self.v_eps), slip_ratio), steer)
        return body.derivative(self.parameters, x, F_x[..., 0] + F_x[..., 1], F_y, body.like(x, u))

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
class Slips(PlantChoice):
    """Tyres with slip and steer as inputs."""

    kind: ClassVar[str] = "slips"
    states = SlipInput.states
    inputs = SlipInput.inputs
    unused = ("J_R", "r_w")
    training, test = "ellipsoid", "ball"
    first = 0  # k = 0 is an approximation already
    chunk, a_sample = 200_000, 1e-5
    v_eps: float = setting(SlipInput.v_eps, above=0, high=100, unit="m/s", help=V_EPS_HELP)
    combined: Combined = setting(SlipInput.combined, option=True, help=COMBINED_HELP)

    def of(self, vehicle: VehicleParameters) -> SlipInput:
        """The plant of a ``vehicle``. Raises ``InvalidValueError`` for one without tyres."""
        return SlipInput(vehicle, self.v_eps, self.combined)
