"""What a plant is, and what a choice of one is."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import ClassVar, Protocol

from koopcli.choices import Choice
from koopcli.records import Channels, FloatArray
from koopcli.vehicles.parameters import VehicleParameters


class Plant(Protocol):
    """A continuous-time system dx/dt = rhs(x, u), vectorised over leading axes."""

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


class PlantChoice(Choice):
    """A kind of plant with what it can be told beside its vehicle, and what is customary with it."""

    states: ClassVar[Channels]
    """Names and units of x."""
    inputs: ClassVar[Channels]
    """Names and units of u."""
    unused: ClassVar[tuple[str, ...]]
    """The parameters of the vehicle that it has no use for."""
    training: ClassVar[str]
    """The kind of sample that predictors are fitted to, unless told otherwise."""
    test: ClassVar[str]
    """The kind of sample that they are tested on."""
    first: ClassVar[int]
    """The first sample that is scored."""
    chunk: ClassVar[int]
    """Samples of a part that is committed; fewer at a time take longer each."""
    a_sample: ClassVar[float]
    """Seconds that the simulation of a sample takes, of 10 ms where the plant is stiff."""
    stiff: ClassVar[bool] = True
    """Whether integration takes several steps for a sample."""

    def of(self, vehicle: VehicleParameters) -> Plant:
        """The plant of a ``vehicle``. Raises ``InvalidValueError`` for one that lacks what it needs."""
        raise NotImplementedError

    @classmethod
    def used(cls, vehicle: VehicleParameters) -> VehicleParameters:
        """The ``vehicle`` with every parameter that the plant does not use at its default."""
        return replace(vehicle, **{name: getattr(VehicleParameters, name) for name in cls.unused})

    @classmethod
    def uses(cls) -> tuple[str, ...]:
        """The parameters of the vehicle that trajectories of the plant tell."""
        return tuple(f.name for f in fields(VehicleParameters) if f.name not in cls.unused)
