"""What artefacts are called where several are drawn, and where they stand on an axis."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from koopcli.choices import written
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
    labels = list(plain)
    for name in dict.fromkeys(plain):
        group = [i for i, label in enumerate(plain) if label == name]
        for i, words in zip(group, differing([dict(settings_of(predictors[i])) for i in group]), strict=True):
            labels[i] = ", ".join([name, *words])
    return labels


def points(against: str, evaluations: Sequence[Task], experiment: Experiment) -> tuple[Series, ...]:
    """One point per evaluation on the axis ``against``, labelled by its curve.

    Settings that differ otherwise are added to the label. Raises ``InvalidValueError`` for a predictor that has no
    number on that axis.
    """
    locate, moved = AXES[against]
    series = [locate(task, experiment) for task in evaluations]
    plain = list(series)
    for label in dict.fromkeys(point.label for point in plain):
        group = [i for i, point in enumerate(plain) if point.label == label]
        differences = differing([_beside(evaluations[i], moved) for i in group])
        for i, words in zip(group, differences, strict=True):
            series[i] = Series(", ".join([label, *words]), plain[i].at)
    return tuple(series)


def differing(settings: Sequence[Mapping[str, Any]]) -> list[list[str]]:
    """Of each of several ``settings`` those that are not the same in all, in words, each once."""
    candidates = list(dict.fromkeys(key for values in settings for key in values))
    keys = [key for key in candidates if any(values.get(key) != settings[0].get(key) for values in settings)]
    return [
        list(dict.fromkeys(f"{key.split('.')[-1]} {_short(values.get(key))}" for key in keys)) for values in settings
    ]


def settings_of(task: Task) -> Iterator[tuple[str, Any]]:
    """Every setting of a task and of what is behind it, by its full name."""
    for step in task.upstream():
        yield from ((f"{step.stage}.{key}", value) for key, value in flat(written(step.settings)))


def _beside(evaluation: Task, moved: Sequence[str]) -> dict[str, Any]:
    """Every setting that two points of one curve have in common."""
    settings = {
        name: value
        for name, value in settings_of(evaluation.input("predictor"))
        if not name.startswith((*moved, *UNTOLD))
    }
    settings |= {f"test/{name}": value for name, value in settings_of(evaluation.input("trajectories"))}
    return settings | {"first": evaluation.settings.first, "restart": evaluation.settings.restart}


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
    shown = {name: Slips.used(variant.vehicle) for name, variant in recipes.vehicles(experiment)}
    vehicle = next((f"{name}: " for name, used in shown.items() if used == steps.vehicle), "")
    fit, about = predictor.settings, outlook(predictor).name
    if isinstance(fit, FitEigen):
        parts = [fit.eigenvalues.kind, fit.lift.kind]
        parts += ["world"] if getattr(fit.window, "coordinates", "") == "world" else []
        parts += ["continued"] if fit.window.rounds else []
        parts += ["composed"] if fit.window.lookup_steps else []
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
