"""What the plants have no use for, so that it is in no key."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

from koopcli.vehicles.parameters import VehicleParameters

PlantName = Literal["forces", "slips", "wheels"]

UNUSED: dict[str, tuple[str, ...]] = {
    "forces": (
        "vehicle.J_R",
        "vehicle.r_w",
        "vehicle.mu_scale",
        "vehicle.lateral",
        "vehicle.longitudinal",
        "vehicle.lateral_rear",
        "vehicle.longitudinal_rear",
        "simulate.v_eps",
        "simulate.combined",
        "simulate.brake_width",
    ),
    "slips": ("vehicle.J_R", "vehicle.r_w", "simulate.force_per", "simulate.brake_width"),
    "wheels": ("simulate.force_per",),
}


def used_of(vehicle: VehicleParameters, plant: str) -> VehicleParameters:
    """The vehicle with every parameter that the ``plant`` does not use at its default."""
    names = [name.partition(".")[2] for name in UNUSED[plant] if name.startswith("vehicle.")]
    return replace(vehicle, **{name: getattr(VehicleParameters, name) for name in names})
