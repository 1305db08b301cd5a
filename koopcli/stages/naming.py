"""What artefacts are called where several are drawn, and where they stand on an axis."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from koopcli.checks import written
from koopcli.config.changes import flat
from koopcli.config.experiment import Experiment
from koopcli.config.pictures import Series
from koopcli.errors import InvalidValueError
from koopcli.koopman.eigen.fit import FitEigen
from koopcli.simulation.samples.box import BoxSample
from koopcli.simulation.samples.point import PointSample
from koopcli.simulation.samples.sample import INPUTS
from koopcli.stages import recipes
from koopcli.stages.base import Task
from koopcli.stages.fits import outlook
from koopcli.vehicles.plants.slips import Slips


def names(predictors: Sequence[Task]) -> list[str]:
    """The labels of predictors. Settings that differ are added where several have one label."""
    plain = [outlook(task).name for task in predictors]
    found = list(plain)
    for name in dict.fromkeys(plain):
        group = [i for i, other in enumerate(plain) if other == name]
        for i, words in zip(group, differing([dict(settings_of(predictors[i])) for i in group]), strict=True):
            found[i] = ", ".join([name, *words])
    return found


def points(against: str, evaluations: Sequence[Task], experiment: Experiment) -> tuple[Series, ...]:
    """One point per evaluation on the axis ``against``, labelled by its curve.

    Settings that differ otherwise are added to the label. Raises ``InvalidValueError`` for a predictor that has no
    number on that axis.
    """
    locate, moved = AXES[against]
    found = [locate(task, experiment) for task in evaluations]
    plain = list(found)
    for label in dict.fromkeys(point.label for point in plain):
        group = [i for i, point in enumerate(plain) if point.label == label]
        said = differing([_beside(evaluations[i], moved) for i in group])
        for i, words in zip(group, said, strict=True):
            found[i] = Series(", ".join([label, *words]), plain[i].at)
    return tuple(found)


def differing(settings: Sequence[Mapping[str, Any]]) -> list[list[str]]:
    """Of each of several ``settings`` those that are not the same in all, in words, each once."""
    known = list(dict.fromkeys(key for one in settings for key in one))
    keys = [key for key in known if any(one.get(key) != settings[0].get(key) for one in settings)]
    return [list(dict.fromkeys(f"{key.split('.')[-1]} {_short(one.get(key))}" for key in keys)) for one in settings]


def settings_of(task: Task) -> Iterator[tuple[str, Any]]:
    """Every setting of a task and of what is behind it, by its full name."""
    for step in task.upstream():
        yield from ((f"{step.stage}.{key}", value) for key, value in flat(written(step.settings)))


def _beside(evaluation: Task, moved: Sequence[str]) -> dict[str, Any]:
    """Every setting that two points of one curve have in common."""
    found = {
        name: value
        for name, value in settings_of(evaluation.input("predictor"))
        if not name.startswith((*moved, *UNTOLD))
    }
    found |= {f"test/{name}": value for name, value in settings_of(evaluation.input("trajectories"))}
    return found | {"first": evaluation.settings.first, "restart": evaluation.settings.restart}


def _order(evaluation: Task, experiment: Experiment) -> Series:
    about = outlook(evaluation.input("predictor"))
    if about.order is None:
        raise InvalidValueError(
            f"the figure takes evaluations of EDMD predictors, which have an order, not of {about.name}"
        )
    test = evaluation.input("trajectories").ancestor("sample").settings
    inputs = INPUTS[test.excitation] if isinstance(test, (BoxSample, PointSample)) else test.kind
    return Series(f"{about.data}, {inputs}", float(about.order))


def _modes(evaluation: Task, experiment: Experiment) -> Series:
    predictor = evaluation.input("predictor")
    fit = predictor.settings
    if not isinstance(fit, FitEigen):
        raise InvalidValueError("the figure takes evaluations of eigenfunctions, which have modes")
    n_x = len(predictor.ancestor("simulate").settings.plant.states)
    return Series(fit.eigenvalues.kind, float(fit.eigenvalues.count(n_x)))


def _seconds(evaluation: Task, experiment: Experiment) -> Series:
    predictor = evaluation.input("predictor")
    simulation = predictor.ancestor("simulate")
    sample, steps = simulation.ancestor("sample").settings, simulation.settings
    shown = {name: Slips.used(there.vehicle) for name, there in recipes.vehicles(experiment)}
    vehicle = next((f"{name}: " for name, one in shown.items() if one == steps.vehicle), "")
    fit, about = predictor.settings, outlook(predictor).name
    if isinstance(fit, FitEigen):
        parts = [fit.eigenvalues.kind, fit.lift.kind]
        parts += ["world"] if getattr(fit.window, "coordinates", "") == "world" else []
        parts += ["continued"] if fit.window.rounds else []
        about = ", ".join([sample.kind, *parts, *(f"{mirror} images" for mirror in fit.mirror)])
    return Series(f"{vehicle}{about}", sample.trajectories * steps.steps * steps.dt)


UNTOLD = ("fit-eigen.trust",)  # what moves no prediction tells no two curves apart

AXES: dict[str, tuple[Callable[[Task, Experiment], Series], tuple[str, ...]]] = {
    "order": (_order, ("fit-edmd.order",)),
    "modes": (_modes, ("fit-eigen.degree", "fit-eigen.pairs")),
    "seconds": (_seconds, ("sample.", "simulate.")),
}  # by name: a point of an evaluation, and beginnings of the settings that move it


def _short(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
