"""The plants by name. A new plant is one class that does what ``Plant`` says, and one line here."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol, Self

from koopcli.checks import build
from koopcli.records import Channels, FloatArray
from koopcli.vehicles.parameters import VehicleParameters
from koopcli.vehicles.single_track import ForceInput, SlipInput


class Plant(Protocol):
    """A continuous-time system dx/dt = rhs(x, u), vectorised over leading axes."""

    @classmethod
    def configured(cls, parameters: VehicleParameters, *, force_per: str, v_eps: float) -> Self:
        """The plant of a vehicle, with those of the options that it has a use for."""

    @property
    def parameters(self) -> VehicleParameters:
        """The vehicle."""

    @property
    def states(self) -> Channels:
        """Names and units of x."""

    @property
    def inputs(self) -> Channels:
        """Names and units of u."""

    def rhs(self, x: FloatArray, u: FloatArray) -> FloatArray:
        """dx/dt (..., n_x) at ``x`` (..., n_x) under ``u`` (..., n_u)."""

    def fastest_rate(self, x: FloatArray, u: FloatArray, dt: float) -> FloatArray | None:
        """The rate in 1/s (...,) that integration over the next ``dt`` s has to resolve, None where there is none."""

    def kinetic_energy(self, x: FloatArray) -> FloatArray:
        """Kinetic energy in J (...,) of the states ``x`` (..., n_x)."""


PLANTS: dict[str, type[ForceInput] | type[SlipInput]] = {
    "forces": ForceInput,
    "slips": SlipInput,
}


def make_plant(name: str, vehicle: VehicleParameters, force_per: str, v_eps: float) -> Plant:
    """The plant ``name`` of a vehicle, with those of the options that it has."""
    return PLANTS[name].configured(vehicle, force_per=force_per, v_eps=v_eps)


def remembered_plant(about: Mapping[str, Any]) -> Plant:
    """The plant that trajectories or a predictor carry along as JSON."""
    vehicle = build(VehicleParameters, about["vehicle"])
    return make_plant(about["plant"], vehicle, about["force_per"], about["v_eps"])
