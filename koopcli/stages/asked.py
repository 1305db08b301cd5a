"""What a predictor is asked: the plant that it is tested on, and how inputs act on it there."""

from __future__ import annotations

from dataclasses import replace

from koopcli.config.settings import Evaluate, Simulate
from koopcli.koopman.eigen.forces import DrivenByForces, with_forces
from koopcli.koopman.predictor.dynamics.force_driven import STRETCHES, ForceDriven
from koopcli.koopman.predictor.predictor import Predictor
from koopcli.koopman.scores.baselines import Forecast
from koopcli.records import Trajectories
from koopcli.stages.base import Task
from koopcli.vehicles.plants import remembered_plant
from koopcli.vehicles.plants.plant import PlantChoice
from koopcli.vehicles.plants.slips import Slips
from koopcli.vehicles.plants.slips_axle_forces import AxleForces, driven


def forces_of(predictor: Task) -> DrivenByForces | None:
    """How forces drive the predictor of a task; None where they do not."""
    inputs = getattr(predictor.settings, "inputs", None)
    return inputs if isinstance(inputs, DrivenByForces) else None


def tested_on(predictor: Task, trained: Simulate) -> Simulate:
    """The simulation that a predictor is tested by, from that of its training trajectories: with changes of axle
    forces where these drive it, though the car coasts in training.
    """
    if forces_of(predictor) is None or not isinstance(trained.plant, Slips):
        return trained
    return replace(trained, plant=AxleForces.around(trained.plant))


def takes(predictor: Task, tested: PlantChoice) -> bool:
    """Whether a predictor knows states and inputs of a ``tested`` plant, or could do without its inputs."""
    trained = predictor.find("simulate")
    if trained is None:
        return True
    if isinstance(trained.settings.plant, Slips) and isinstance(tested, AxleForces):
        return True  # what coasts, and baselines, are tested beside what forces drive
    return bool(tested_on(predictor, trained.settings).plant.inputs == tested.inputs)  # type: ignore[union-attr]


def in_force(settings: Evaluate, predictor: Task) -> Evaluate:
    """The ``settings`` without an input matrix for a predictor that has none, and without the stretches of one that has
    no stretches.
    """
    forces = forces_of(predictor)
    if forces is None:
        return replace(settings, input_matrix=None, every=None)
    matrix = settings.input_matrix or forces.input_matrix
    return settings if matrix in STRETCHES else replace(settings, every=None)


def as_fitted(predictor: Task, settings: Evaluate) -> Task:
    """The task of the predictor that would answer as this one does with the input matrix of ``settings``."""
    forces = forces_of(predictor)
    if forces is None:
        return predictor
    forces = replace(
        forces, input_matrix=settings.input_matrix or forces.input_matrix, every=settings.every or forces.every
    )
    return replace(predictor, settings=replace(predictor.settings, inputs=forces))


def lifts(predictor: Task, steps: int) -> int:
    """How often a state is lifted in a prediction of so many ``steps``."""
    forces = forces_of(predictor)
    if forces is None or forces.input_matrix == "first":
        return 1
    stretches = steps if forces.input_matrix == "relift" else -(-steps // forces.every)
    return stretches + (forces.input_matrix == "between")


def as_asked(predictor: Predictor | Forecast, settings: Evaluate, trajectories: Trajectories) -> Predictor | Forecast:
    """The ``predictor`` with the input matrix of ``settings``.

    Of a coasting car it takes the inputs of ``trajectories`` with changes of axle forces: a baseline knows what they
    do, a predictor that knows no inputs ignores them and is without its estimate of errors, which is one of coasting.
    """
    if isinstance(predictor, Predictor) and isinstance(predictor.dynamics, ForceDriven):
        known = predictor.dynamics
        if settings.input_matrix is None and settings.every is None:
            return predictor
        vehicle = remembered_plant(predictor.plant).parameters
        return with_forces(
            predictor, vehicle, settings.input_matrix or known.input_matrix, settings.every or known.every
        )
    if predictor.plant.get("plant") != Slips.kind or trajectories.plant.get("plant") != AxleForces.kind:
        return predictor
    if isinstance(predictor, Forecast):
        return replace(predictor, input_channels=trajectories.input_channels, plant=driven(predictor.plant))
    if predictor.knows_inputs:
        return predictor
    return replace(predictor, input_channels=trajectories.input_channels, trust=None)
