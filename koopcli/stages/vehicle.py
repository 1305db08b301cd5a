"""What is said of the vehicle behind a task: values that look like those of another unit, and another vehicle that
makes the same.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import fields

from koopcli.choices import taken
from koopcli.config.experiment import Experiment
from koopcli.figures.kit.registry import FIGURES
from koopcli.simulation.portrait import measures, odd
from koopcli.stages.base import Task
from koopcli.vehicles.parameters import VehicleParameters

NAMES = tuple(f.name for f in fields(VehicleParameters))


def doubts(step: Task) -> Iterator[str]:
    """What of the vehicle that ``step`` uses is far from any road vehicle's; a grip has no unit that may be wrong."""
    if step.stage not in ("sample", "simulate"):
        return
    vehicle = getattr(step.settings, "vehicle", None)
    if vehicle is None:
        yield from odd({name: getattr(step.settings, name, None) for name in ("m", "r_w")})
    else:
        yield from odd({name: value for name, value in measures(vehicle).items() if name != "peak grip"})


def makes_the_same(experiment: Experiment, tasks: Sequence[Task]) -> str | None:
    """What is said where the vehicle that was named last makes the same ``tasks`` as the one in its place would."""
    unnamed = experiment.before_naming()
    steps = [step for task in tasks for step in task.upstream() if step.key is None]
    steps = [step for step in steps if step.stage in ("sample", "simulate")]
    if unnamed is None or unnamed.vehicle_name == experiment.vehicle_name:
        return None
    if not steps:
        drawn = [task.settings.figure for task in tasks if task.stage == "plot"]
        plain = [figure for figure in drawn if not FIGURES[figure].parameters]
        return f"the figure '{plain[0]}' draws nothing of {experiment.vehicle_name}" if plain else None
    names = f"{experiment.vehicle_name} and {unnamed.vehicle_name}"
    differing = [name for name in NAMES if getattr(experiment.vehicle, name) != getattr(unnamed.vehicle, name)]
    if not differing:
        return f"{names} have the same parameters: what is made is the same"
    if any(name in _used(step) for step in steps for name in differing):
        return None
    plants = sorted({f"the plant '{step.settings.plant.kind}'" for step in steps if step.stage == "simulate"})
    users = plants or sorted({f"a sample of kind '{step.settings.kind}'" for step in steps})
    return f"{names} differ only in {', '.join(differing)}, which {users[0]} does not use: what is made is the same"


def _used(step: Task) -> set[str]:
    """The parameters of the vehicle that a sample or a simulation depends on."""
    settings = step.settings
    if not hasattr(settings, "vehicle"):
        return set(taken(type(settings)))
    plant = settings.plant if step.stage == "simulate" else settings.meant_for
    return set(plant.uses())
