"""What stands beside a record in its file for whoever opens it with other tools; no key and no digest knows of it."""

from __future__ import annotations

from koopcli import __version__
from koopcli.config.settings import Simulate
from koopcli.config.shipped import fingerprint, titled
from koopcli.records import Packed
from koopcli.stages.base import Task
from koopcli.stages.recipes import remembered_simulation
from koopcli.store.image import Labels


def labels(task: Task, packed: Packed) -> Labels:
    """Koop's version, and of what was simulated ``dt`` in s, the plant and the title of the vehicle, where all that is
    behind a ``task`` has the same.
    """
    simulations = {step.settings for step in task.upstream() if step.stage == "simulate"} or _remembered(packed)
    told = [_told(simulation) for simulation in simulations]
    same = {name: value for about in told[:1] for name, value in about.items() if all(a[name] == value for a in told)}
    return {**same, "koop": __version__}


def _remembered(packed: Packed) -> set[Simulate]:
    """The simulation that a predictor remembers, where its trajectories are gone from the store."""
    meta = packed.meta
    return {remembered_simulation(meta["plant"], meta["dt"])} if meta.get("plant") and "dt" in meta else set()


def _told(simulation: Simulate) -> dict[str, str | float]:
    plant = simulation.plant
    assert plant is not None, "settled when it was simulated"
    return {
        "dt": simulation.dt,
        "plant": plant.kind,
        "vehicle": titled(fingerprint(simulation.vehicle, plant.uses())),
    }
