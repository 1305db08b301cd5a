"""What the plants have no use for, so that it is in no key."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

from koopcli.vehicles.parameters import VehicleParameters

PlantName = Literal["forces", "slips"]

UNUSED: dict[str, tuple[str, ...]] = {
    "forces": (
        "vehicle.J_R",
        "vehicle.r_w",
        "vehicle.mu_scale",
        "vehicle.lateral",
        "vehicle.longitudinal",
        "simulate.v_eps",
    ),
    "slips": ("vehicle.J_R", "vehicle.r_w", "simulate.force_per"),
}


def used_of(vehicle: VehicleParameters, plant: str) -> VehicleParameters:
    """The vehicle with every parameter that the ``plant`` does not use at its default."""
    names = [name.partition(".")[2] for name in UNUSED[plant] if name.startswith("vehicle.")]
    return replace(vehicle, **{name: getattr(VehicleParameters, name) for name in names})
