"""What a figure is of: the vehicles and predictors behind the artefacts that it draws."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from koopcli.choices import taken
from koopcli.config.experiment import Experiment
from koopcli.config.pictures import Subject
from koopcli.config.settings import Simulate
from koopcli.config.shipped import Fingerprint, fingerprint
from koopcli.errors import UnknownNameError
from koopcli.stages import recipes
from koopcli.stages.base import Task
from koopcli.stages.fits import FITS, outlook


def subject(artefacts: Sequence[Task], simulated: Callable[[Task], Simulate]) -> Subject:
    """The vehicles and predictors behind ``artefacts``, as far as their records are known, each once.

    ``simulated`` finds the simulation behind a predictor whose trajectories are gone.
    """
    drawn = [task.input("predictor") if task.stage == "score" else task for task in artefacts]
    steps = list(dict.fromkeys(step for task in drawn for step in task.upstream()))
    predictors = [step for step in steps if step.stage in FITS]
    vehicles = dict.fromkeys(_simulations(steps, predictors, simulated)) or dict.fromkeys(_samples(steps))
    return Subject(tuple(vehicles), tuple(outlook(predictor).name for predictor in predictors))


def of_vehicles(experiment: Experiment, parameters: Sequence[str]) -> Subject:
    """The experiment's vehicles, of which ``parameters`` are drawn."""
    vehicles = (variant.vehicle for _, variant in recipes.vehicles(experiment))
    return Subject(tuple(dict.fromkeys(fingerprint(vehicle, tuple(parameters)) for vehicle in vehicles)))


def _simulations(
    steps: Sequence[Task], predictors: Sequence[Task], simulated: Callable[[Task], Simulate]
) -> Iterator[Fingerprint]:
    simulations = [step.settings for step in steps if step.stage == "simulate"]
    if not simulations:
        for predictor in predictors:
            if predictor.find("import") is not None:  # of a car that was measured
                continue
            try:
                simulations.append(simulated(predictor))
            except UnknownNameError:  # its record is gone too
                continue
    for settings in simulations:
        yield fingerprint(settings.vehicle, settings.plant.uses())


def _samples(steps: Sequence[Task]) -> Iterator[Fingerprint]:
    """What samples hold of a vehicle where nothing was simulated."""
    for step in steps:
        if step.stage == "sample" and hasattr(step.settings, "vehicle"):
            yield fingerprint(step.settings.vehicle, step.settings.meant_for.uses())
        elif step.stage == "sample" and (names := tuple(taken(type(step.settings)))):
            yield fingerprint(step.settings, names)
