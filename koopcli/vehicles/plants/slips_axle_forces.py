"""The coasting car on tyres with changes of its axle forces as inputs (docs/equations.md 7.23). ISO 8855 signs."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from koopcli.choices import setting
from koopcli.records import Channels, FloatArray
from koopcli.vehicles import body
from koopcli.vehicles.axles import COMBINED_HELP, V_EPS_HELP, Axles, Combined, check_tyres
from koopcli.vehicles.parameters import VehicleParameters
from koopcli.vehicles.plants.plant import PlantChoice
from koopcli.vehicles.plants.slips import SlipInput, Slips


@dataclass(frozen=True)
class ForceChange:
    """ẋ = f(x) + G ΔF with the coasting car f of the plant ``slips``, at zero steer and slip, eq. (7.23).

    State ``x = [v_x, v_y, yaw_rate]`` in m/s, m/s, rad/s; input ``u = [dF_fx, dF_fy, dF_rx, dF_ry]`` in N: how the
    body-fixed forces of both wheels of an axle together differ from those of the coasting car. ``v_eps`` and
    ``combined`` as in ``SlipInput``.

    Raises ``InvalidValueError`` for a vehicle without tyres.
    """

    parameters: VehicleParameters
    v_eps: float = SlipInput.v_eps
    combined: Combined = SlipInput.combined

    states: ClassVar[Channels] = body.STATES
    inputs: ClassVar[Channels] = Channels(("dF_fx", "dF_fy", "dF_rx", "dF_ry"), ("N",) * 4)

    def __post_init__(self) -> None:
        check_tyres(self.parameters, "axle-forces")

    def rhs(self, x: FloatArray, u: FloatArray) -> FloatArray:
        """Time derivative of ``x`` (..., 3) under ``u`` (..., 4); without forces that of the coasting car."""
        dx = self._coasting.rhs(x, np.zeros_like(u))
        for state, change in enumerate(self._changes(u)):
            dx[..., state] += change
        return dx

    def fastest_rate(self, x: FloatArray, u: FloatArray, dt: float) -> FloatArray:
        """How fast the tyres pull lateral speeds to rest within the next ``dt`` s, (6.5), for ``x`` (..., 3).

        In 1/s, (...,); not more than an estimate, since speeds change in that time.
        """
        axles, steer = self._axles, np.zeros_like(u[..., 0::2])
        along, across = axles.slowest(x, steer, dt)
        forward, sideways, turning = (dt * np.abs(change)[..., np.newaxis] for change in self._changes(u))
        along = np.maximum(along - forward, self.v_eps)
        across = np.maximum(across - sideways - np.abs(axles.arms) * turning, 0.0)
        return axles.settling_rate(along, across)

    def kinetic_energy(self, x: FloatArray) -> FloatArray:
        """Kinetic energy in J of the states ``x`` (..., 3)."""
        return body.kinetic_energy(self.parameters, x)

    def _changes(self, u: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """What ``u`` (..., 4) changes in the derivative of each state, (...,)."""
        p, (F_fx, F_fy, F_rx, F_ry) = self.parameters, np.moveaxis(u, -1, 0)
        return (F_fx + F_rx) / p.m, (F_fy + F_ry) / p.m, (p.l_f * F_fy - p.l_r * F_ry) / p.Jzz

    @cached_property
    def _coasting(self) -> SlipInput:
        return SlipInput(self.parameters, self.v_eps, self.combined)

    @cached_property
    def _axles(self) -> Axles:
        return Axles(self.parameters, self.v_eps, self.combined)


@dataclass(frozen=True)
class AxleForces(PlantChoice):
    """The coasting car with changes of its axle forces as inputs."""

    kind: ClassVar[str] = "axle-forces"
    states = ForceChange.states
    inputs = ForceChange.inputs
    unused = Slips.unused
    training = test = "ball-forces"
    first = Slips.first
    chunk, a_sample = Slips.chunk, Slips.a_sample
    v_eps: float = setting(SlipInput.v_eps, above=0, high=100, unit="m/s", help=V_EPS_HELP)
    combined: Combined = setting(SlipInput.combined, option=True, help=COMBINED_HELP)

    @classmethod
    def around(cls, coasting: Slips) -> AxleForces:
        """The plant whose car coasts as that of the plant ``coasting`` does."""
        return cls(coasting.v_eps, coasting.combined)

    def of(self, vehicle: VehicleParameters) -> ForceChange:
        """The plant of a ``vehicle``. Raises ``InvalidValueError`` for one without tyres."""
        return ForceChange(vehicle, self.v_eps, self.combined)


def driven(plant: dict[str, Any]) -> dict[str, Any]:
    """The ``plant`` of coasting trajectories, as they remember it, with changes of axle forces as inputs."""
    return {**plant, "plant": AxleForces.kind} if plant.get("plant") == Slips.kind else plant
