"""Single-track equations of motion from tyre forces (docs/equations.md 1). ISO 8855 signs, as in ``body``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

from koopcli.choices import setting
from koopcli.records import Channels, FloatArray
from koopcli.vehicles import body
from koopcli.vehicles.parameters import TYRES, VehicleParameters
from koopcli.vehicles.plants.plant import PlantChoice

WHEELS_PER_FORCE = {"axle": 1, "wheel": 2}


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

    def rhs(self, x: FloatArray, u: FloatArray) -> FloatArray:
        """Time derivative of ``x`` (..., 3) under ``u`` (..., 4), eqs. (1.1) to (1.3)."""
        forces = self.wheels_per_force * u
        return body.derivative(self.parameters, x, forces[..., 0] + forces[..., 2], forces[..., 1::2], body.like(x, u))

    def fastest_rate(self, x: FloatArray, u: FloatArray, dt: float) -> FloatArray | None:
        """Nothing here is stiff: one integration step a sample will do."""
        return None

    def kinetic_energy(self, x: FloatArray) -> FloatArray:
        """Kinetic energy in J of the states ``x`` (..., 3)."""
        return body.kinetic_energy(self.parameters, x)


@dataclass(frozen=True)
class Forces(PlantChoice):
    """Tyre forces as inputs."""

    kind: ClassVar[str] = "forces"
    states = ForceInput.states
    inputs = ForceInput.inputs
    unused = ("J_R", "r_w", "mu_scale", *TYRES)
    training, test = "grid", "box"
    first = 1  # the states are observables, so k = 0 is exact
    chunk, a_sample, stiff = 500_000, 3e-7, False
    force_per: Literal["axle", "wheel"] = setting("axle", option=True, help="what an input force acts on")

    def of(self, vehicle: VehicleParameters) -> ForceInput:
        """The plant of a ``vehicle``."""
        return ForceInput(vehicle, WHEELS_PER_FORCE[self.force_per])
