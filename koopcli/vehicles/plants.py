"""The plants by name. A new plant is one class with ``states``, ``inputs`` and ``rhs``, and one line here."""

from __future__ import annotations

from typing import Protocol

from koopcli.records import Channels, FloatArray
from koopcli.vehicles.single_track import ForceInput


class Plant(Protocol):
    """A continuous-time system dx/dt = rhs(x, u), vectorised over leading axes."""

    @property
    def states(self) -> Channels:
        """Names and units of x."""

    @property
    def inputs(self) -> Channels:
        """Names and units of u."""

    def rhs(self, x: FloatArray, u: FloatArray) -> FloatArray:
        """dx/dt (..., n_x) at ``x`` (..., n_x) under ``u`` (..., n_u)."""


PLANTS: dict[str, type[ForceInput]] = {
    "forces": ForceInput,
}

SAMPLED_FOR = {"grid": "forces", "box": "forces"}  # the plant whose states and inputs a kind of sample draws

WHEELS_PER_FORCE = {"axle": 1, "wheel": 2}
