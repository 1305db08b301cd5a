"""The plants. A new plant is one file in this folder: its equations of motion, and its choice with settings."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from koopcli.checks import build, restored
from koopcli.choices import import_files
from koopcli.vehicles.parameters import VehicleParameters
from koopcli.vehicles.plants.plant import Plant, PlantChoice

import_files(__name__, __path__)

PLANTS = PlantChoice.kinds()


def remembered_plant(about: Mapping[str, Any]) -> Plant:
    """The plant that trajectories or a predictor carry along as JSON."""
    rest = dict(about)
    vehicle = build(VehicleParameters, rest.pop("vehicle"))
    return restored(PlantChoice, {"kind": rest.pop("plant"), **rest}).of(vehicle)
