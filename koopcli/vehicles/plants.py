"""The plants by name. A new plant is one class that does what ``Plant`` says, and one line here."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol, Self

from koopcli.checks import build
from koopcli.records import Channels, FloatArray
from koopcli.vehicles.options import OPTIONS, Options
from koopcli.vehicles.parameters import VehicleParameters
from koopcli.vehicles.single_track import ForceInput, SlipInput, TorqueInput


class Plant(Protocol):
    """A continuous-time system dx/dt = rhs(x, u), vectorised over leading axes."""

    @classmethod
    def configured(cls, parameters: VehicleParameters, options: Options) -> Self:
        """The plant of a vehicle with the ``options`` that it has a use for."""

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


PLANTS: dict[str, type[ForceInput] | type[SlipInput] | type[TorqueInput]] = {
    "forces": ForceInput,
    "slips": SlipInput,
    "wheels": TorqueInput,
}


def remembered_plant(about: Mapping[str, Any]) -> Plant:
    """The plant that trajectories or a predictor carry along as JSON."""
    options = Options(**{name: about[name] for name in OPTIONS if name in about})
    return PLANTS[about["plant"]].configured(build(VehicleParameters, about["vehicle"]), options)
