"""From artefacts to a figure: which it takes, what they are called in it, and which it makes when none is named."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from koopcli.checks import build
from koopcli.config.experiment import Experiment
from koopcli.config.pictures import ImageFormat, Plot, Series
from koopcli.config.settings import Simulate
from koopcli.errors import InvalidValueError, UnknownNameError
from koopcli.figures import source_digest
from koopcli.figures.kit.figure import FigureKind
from koopcli.figures.kit.registry import FIGURES
from koopcli.simulation.samples.point import PointSample
from koopcli.stages import grid, recipes
from koopcli.stages.base import Task
from koopcli.stages.naming import names, points
from koopcli.stages.subject import of_vehicles, subject

OF_LOGS = {
    "import": "log",
    "select": "selection",
    "score": "score",
    "control": "loop",
}  # stages, and what a figure calls what they make
TOLD_BESIDE = ("test", "plot")  # sections that matter beside a named predictor


def artefacts(name: str, experiment: Experiment) -> list[Task]:
    """What the figure ``name`` draws when nothing is named.

    Raises ``InvalidValueError`` for an experiment about a fit that the figure is not for.
    """
    kind, about = FIGURES[name], experiment.about.fit
    if kind.only is not None and about not in (None, kind.only):
        raise InvalidValueError(
            f"the figure makes {kind.only} predictors, the experiment is about {about}: name what to draw, or add "
            f"--set experiment.fit={kind.only}"
        )
    if kind.makes is not None:
        return kind.makes(recipes, experiment)
    if kind.takes == "nothing":
        return []
    if kind.takes in OF_LOGS.values():
        raise InvalidValueError(
            f"the figure '{name}' draws a {kind.takes} of your own data, which koop cannot make: name it"
        )
    if kind.takes == "sweep":
        return [grid.order_grid(experiment)]
    predictor = recipes.predictor(experiment, kind.usual or kind.only or "fit-edmd")
    return [recipes.evaluation(experiment, predictor) if kind.takes == "evaluation" else predictor]


def simulated(predictor: Task) -> Simulate:
    """The simulation behind a predictor whose trajectories are known."""
    settings: Simulate = predictor.ancestor("simulate").settings
    return settings


def figure(
    name: str,
    artefacts: Sequence[Task],
    image: ImageFormat,
    experiment: Experiment,
    simulated: Callable[[Task], Simulate] = simulated,
    labels: Mapping[Task, str] | None = None,
) -> Task:
    """The figure ``name`` of ``artefacts``, told what ``experiment`` says.

    ``simulated`` finds the simulation behind a predictor; ``labels`` are what artefacts are called, where their
    settings are not to say it. Raises ``UnknownNameError`` for samples of another kind;
    ``InvalidValueError`` for more artefacts than the figure draws, for evaluations on different test sets, and for two
    that would be one point of one curve.
    """
    kind = FIGURES[name]
    _check(name, kind, artefacts)
    if kind.takes == "predictor":
        for task in artefacts:
            _check_plant(name, task, simulated(task))
    inputs = tuple(
        (f"{i}/{role}", _behind(task, role, experiment, simulated))
        for i, task in enumerate(artefacts)
        for role in kind.roles
    )
    told = {field: find(recipes, experiment, artefacts) for field, find in kind.told.items()}
    of = of_vehicles(experiment, kind.parameters) if kind.parameters else subject(artefacts, simulated)
    about = {"figure": name, "format": image, "drawn_by": source_digest(name), "of": of}
    return Task("plot", build(Plot, {**about, "series": _series(kind, artefacts, experiment, labels), **told}), inputs)


def _check(name: str, kind: FigureKind, artefacts: Sequence[Task]) -> None:
    if kind.draws == "one" and len(artefacts) > 1:
        raise InvalidValueError(f"the figure '{name}' draws one {kind.takes}, got {len(artefacts)}")
    for task in artefacts:
        if kind.takes == "evaluation" and "trajectories" in kind.roles and task.settings.restart is not None:
            raise InvalidValueError(
                f"{task.name} holds predictions that restart every {task.settings.restart} steps; the figure '{name}' "
                "draws one prediction for each trajectory: evaluate without --restart"
            )
        if kind.kinds and task.settings.kind not in kind.kinds:
            raise UnknownNameError(
                f"{task.name} is a sample of kind '{task.settings.kind}'; the figure '{name}' takes those of kind "
                f"{' or '.join(kind.kinds)}"
            )
    if kind.draws == "beside" and kind.takes == "evaluation":
        for artefact in artefacts[1:]:
            _check_shared(name, artefacts[0], artefact)


def _check_plant(name: str, predictor: Task, simulation: Simulate) -> None:
    """Refuse a predictor of a plant that the trajectory made for the figure cannot drive."""
    meant = PointSample.meant_for
    plant = simulation.plant
    assert plant is not None, "settled when it was simulated"
    if plant.inputs != meant.inputs:
        raise InvalidValueError(
            f"the figure '{name}' takes predictors of the plant '{meant.kind}', {predictor.name} is of '{plant.kind}'"
        )


def _check_shared(name: str, a: Task, b: Task) -> None:
    """Refuse two evaluations that did not score the same samples of the same trajectories."""
    test_a, test_b = a.input("trajectories"), b.input("trajectories")
    mine, theirs = test_a.settings.plant.kind, test_b.settings.plant.kind
    if mine != theirs:
        raise InvalidValueError(
            f"{a.name} is of the plant '{mine}', {b.name} of '{theirs}': the figure '{name}' draws predictors of "
            "one plant, on one test set"
        )
    if test_a != test_b:
        raise InvalidValueError(
            f"the figure '{name}' draws predictors on one test set, but {a.name} is of {test_a.name} and {b.name} "
            f"of {test_b.name}: evaluate each predictor with --on {test_a.name}"
        )
    if a.settings.restart != b.settings.restart:
        raise InvalidValueError(f"{a.name} and {b.name} restart differently: evaluate both with one --restart")
    if a.settings.first != b.settings.first:
        raise InvalidValueError(
            f"{a.name} is scored from sample k = {a.settings.first}, {b.name} from k = "
            f"{b.settings.first}: evaluate both with one --set evaluate.first"
        )


def _behind(task: Task, role: str, experiment: Experiment, simulated: Callable[[Task], Simulate]) -> Task:
    """An artefact itself, what it was made from, or the test trajectory that is made for a predictor."""
    if role == "training":
        return (task.input("predictor") if task.stage == "evaluate" else task).input("trajectories")
    if task.stage in OF_LOGS:
        return task if role == OF_LOGS[task.stage] else task.input(role)
    if task.stage == "simulate":
        return task
    if task.stage == "evaluate":
        return task if role == "evaluation" else task.input(role)
    return recipes.driven(experiment, simulated(task)) if role == "trajectories" else task


def _series(
    kind: FigureKind, artefacts: Sequence[Task], experiment: Experiment, labels: Mapping[Task, str] | None
) -> tuple[Series, ...]:
    """What each of several artefacts is called; nothing where the figure draws one."""
    if kind.draws == "one":
        return ()
    for task in artefacts:
        if list(artefacts).count(task) > 1:
            raise InvalidValueError(f"{task.name} is named twice: name each evaluation once")
    if kind.draws == "points":
        series = points(kind.against, artefacts, experiment)
    elif labels is not None:
        series = tuple(Series(labels[task]) for task in artefacts)
    elif kind.takes == "loop":
        loops = [task.settings for task in artefacts]
        series = tuple(Series(f"{loop.controller.kind}, {loop.scenario}") for loop in loops)
    else:
        series = tuple(Series(label) for label in names([task.input("predictor") for task in artefacts]))
    for entry in series:
        if series.count(entry) > 1:
            what = entry.label if entry.at is None else f"{kind.against} {entry.at:g}, {entry.label}"
            raise InvalidValueError(f"several evaluations of {what}: name each once, and those of one experiment")
    return series
