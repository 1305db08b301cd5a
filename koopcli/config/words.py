"""Settings by their full names and in the words of a command line, where only their values are known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from koopcli.choices import told, written
from koopcli.config.changes import flat
from koopcli.config.experiment import DEFAULT_VEHICLE
from koopcli.config.grids import text_of
from koopcli.config.settings import Simulate
from koopcli.config.shipped import vehicles
from koopcli.simulation.samples.sample import SampleChoice
from koopcli.vehicles.parameters import VehicleParameters
from koopcli.vehicles.plants.plant import PlantChoice

Words = dict[str, str]


def vehicle_words(vehicle: VehicleParameters, plant: PlantChoice) -> Words | None:
    """The shipped vehicle that differs least in what the ``plant`` uses of ``vehicle``, with the differences; None
    where each has something that this one has not.
    """
    mine = _flat(vehicle, plant)
    changes = {name: _differing(mine, _flat(theirs.parameters, plant)) for name, theirs in vehicles().items()}
    sayable = [name for name, changed in changes.items() if None not in changed.values()]
    if not sayable:
        return None
    nearest = min(sayable, key=lambda name: (len(changes[name]), name != DEFAULT_VEHICLE, name))
    chosen = {} if nearest == DEFAULT_VEHICLE else {"name": nearest}
    return _words("vehicle", {**chosen, **changes[nearest]})


def plant_words(simulate: Simulate) -> Words:
    """What makes another plant of its vehicle than it is by default."""
    period = {} if simulate.dt == Simulate.dt else {"dt": simulate.dt}
    return _words("simulate", {**(told(simulate.plant) if simulate.plant else {}), **period})


def sample_words(sample: SampleChoice, names: Sequence[str]) -> Words:
    """Those of the settings ``names`` of a sample that are not at their defaults."""
    mine, usual = ({name: getattr(of, name) for name in names if hasattr(of, name)} for of in (sample, type(sample)))
    return _words("sample", _differing(mine, usual))


def _flat(vehicle: VehicleParameters, plant: PlantChoice) -> dict[str, Any]:
    return dict(flat(written(plant.used(vehicle))))


def _differing(mine: Mapping[str, Any], theirs: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in mine.items() if name not in theirs or theirs[name] != value}


def _words(section: str, changed: Mapping[str, Any]) -> Words:
    return {
        f"{section}.{name}": text_of(list(value) if isinstance(value, tuple) else value)
        for name, value in changed.items()
    }
