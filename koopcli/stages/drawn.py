"""From artefacts to a figure: which it takes, what they are called in it, and which it makes when none is named."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from koopcli.checks import build
from koopcli.config.experiment import Experiment, flat
from koopcli.config.samples import INPUTS, SAMPLED_FOR, BoxSample, PointSample
from koopcli.config.settings import ImageFormat, Plot, Series, Simulate
from koopcli.errors import InvalidValueError, UnknownNameError
from koopcli.figures import source_digest
from koopcli.figures.registry import FIGURES, FigureKind
from koopcli.stages import recipes
from koopcli.stages.base import Task
from koopcli.stages.makers import LIFTED, MAKERS, prospect
from koopcli.vehicles.plants import PLANTS

TAKES: dict[str, tuple[str, ...]] = {
    "evaluation": ("evaluate",),
    "predictor": tuple(MAKERS),
    "fit": LIFTED,
    "sample": ("sample",),
    "nothing": (),
}
TOLD_BESIDE = ("test", "plot")  # sections that matter beside a named predictor


@dataclass(frozen=True)
class Made:
    """What a figure makes when nothing is named.

    ``reads``: beginnings of settings that matter beside those of the tasks; ``fixed``: of those that the figure
    chooses itself, with what to do ``instead`` of changing them.
    """

    tasks: Callable[[Experiment], list[Task]]
    reads: tuple[str, ...] = ()
    fixed: tuple[str, ...] = ()
    instead: str = ""


MADE: dict[str, Made] = {
    "orders": Made(
        recipes.order_sweep,
        reads=("reproduce.orders",),
        fixed=("fit-edmd.order", "reproduce.draw", "reproduce.excitations"),
        instead="it sweeps reproduce.orders with sample.draw and test.excitation",
    ),
    "draws": Made(
        recipes.draw_sweep,
        reads=("reproduce.orders", "reproduce.full_draws"),
        fixed=("fit-edmd.order", "sample.seed", "sample.grid.seed", "reproduce.draw"),
        instead="it sweeps reproduce.orders over reproduce.full_draws random grids",
    ),
    "eigen": Made(lambda experiment: [recipes.evaluation(experiment, recipes.fit_eigen(experiment))]),
    "beside": Made(
        recipes.side_by_side,
        fixed=("fit-edmd.", "baseline."),
        instead="it sets eigenfunctions beside fixed baselines and EDMD fits; name evaluations to choose others",
    ),
    "edmd-fit": Made(lambda experiment: [recipes.fit_edmd(experiment)]),
    "surface": Made(lambda experiment: [recipes.sample(experiment.sample("ellipsoid"))]),
    "vehicles": Made(
        lambda experiment: [],
        reads=("reproduce.beside", "vehicle.name", *(f"vehicle.{name}" for name in recipes.OF_TYRES)),
    ),
    "nothing": Made(lambda experiment: []),
}


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
) -> Task:
    """The figure ``name`` of ``artefacts``, told what ``experiment`` says.

    ``simulated`` finds the simulation behind a predictor. Raises ``UnknownNameError`` for samples of another kind;
    ``InvalidValueError`` for more artefacts than the figure draws, for evaluations on different test sets, and for two
    that would be one point of one curve.
    """
    kind = FIGURES[name]
    _check(name, kind, artefacts)
    if kind.takes == "predictor":
        for task in artefacts:
            _check_plant(name, task, simulated(task).plant)
    inputs = tuple(
        (f"{i}/{role}", _behind(task, role, experiment, simulated))
        for i, task in enumerate(artefacts)
        for role in kind.roles
    )
    told = {field: TOLD[field](experiment) for field in kind.told}
    about = {"figure": name, "format": image, "drawn_by": source_digest()}
    return Task("plot", build(Plot, {**about, "series": _series(name, kind, artefacts), **told}), inputs)


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
    if kind.draws == "beside":
        for other in artefacts[1:]:
            _check_shared(name, artefacts[0], other)


def _check_plant(name: str, predictor: Task, plant: str | None) -> None:
    """Refuse a predictor of a plant that the trajectory made for the figure cannot drive."""
    meant = SAMPLED_FOR["point"]
    assert plant is not None, "settled when it was simulated"
    if PLANTS[plant].inputs != PLANTS[meant].inputs:
        raise InvalidValueError(
            f"the figure '{name}' takes predictors of the plant '{meant}', {predictor.name} is of '{plant}'"
        )


def _check_shared(name: str, one: Task, other: Task) -> None:
    """Refuse two evaluations that did not score the same samples of the same trajectories."""
    here, there = one.input("trajectories"), other.input("trajectories")
    if here.settings.plant != there.settings.plant:
        raise InvalidValueError(
            f"{one.name} is of the plant '{here.settings.plant}', {other.name} of '{there.settings.plant}': the figure "
            f"'{name}' draws predictors of one plant, on one test set"
        )
    if here != there:
        raise InvalidValueError(
            f"the figure '{name}' draws predictors on one test set, but {one.name} is of {here.name} and {other.name} "
            f"of {there.name}: evaluate each predictor with --on {here.name}"
        )
    if one.settings.restart != other.settings.restart:
        raise InvalidValueError(f"{one.name} and {other.name} restart differently: evaluate both with one --restart")
    if one.settings.first != other.settings.first:
        raise InvalidValueError(
            f"{one.name} is scored from sample k = {one.settings.first}, {other.name} from k = "
            f"{other.settings.first}: evaluate both with one --set evaluate.first"
        )


def _behind(task: Task, role: str, experiment: Experiment, simulated: Callable[[Task], Simulate]) -> Task:
    """An artefact itself, what it was made from, or the test trajectory that is made for a predictor."""
    if role == "training":
        return (task.input("predictor") if task.stage == "evaluate" else task).input("trajectories")
    if task.stage == "evaluate":
        return task if role == "evaluation" else task.input(role)
    return recipes.driven(experiment, simulated(task)) if role == "trajectories" else task


def _series(name: str, kind: FigureKind, artefacts: Sequence[Task]) -> tuple[Series, ...]:
    """What each of several artefacts is called; nothing where the figure draws one."""
    if kind.draws == "one":
        return ()
    for task in artefacts:
        if list(artefacts).count(task) > 1:
            raise InvalidValueError(f"{task.name} is named twice: name each evaluation once")
    if kind.draws == "points":
        series = _points(name, artefacts)
    else:
        series = tuple(Series(label) for label in _names([task.input("predictor") for task in artefacts]))
    for one in series:
        if series.count(one) > 1:
            what = one.label if one.order is None else f"order {one.order}, {one.label}"
            raise InvalidValueError(f"several evaluations of {what}: name each once, and those of one experiment")
    return series


def _points(name: str, evaluations: Sequence[Task]) -> tuple[Series, ...]:
    """Points of curves; those of one curve differ in the order alone, or it is told apart by what else differs."""
    points = [_point(name, task) for task in evaluations]
    found = list(points)
    for label in dict.fromkeys(point.label for point in points):
        group = [i for i, point in enumerate(points) if point.label == label]
        said = _differing([_of_a_point(evaluations[i]) for i in group])
        for i, words in zip(group, said, strict=True):
            found[i] = Series(", ".join([label, *words]), points[i].order)
    return tuple(found)


def _of_a_point(evaluation: Task) -> dict[str, Any]:
    """Every setting that two points of one curve have in common."""
    found = dict(_settings(evaluation.input("predictor")))
    del found["fit-edmd.order"]
    found |= {f"test/{name}": value for name, value in _settings(evaluation.input("trajectories"))}
    return found | {"first": evaluation.settings.first, "restart": evaluation.settings.restart}


def _differing(settings: Sequence[Mapping[str, Any]]) -> list[list[str]]:
    """Of each of several ``settings`` those that are not the same in all, in words, each once."""
    names = [key for key in settings[0] if any(one.get(key) != settings[0][key] for one in settings)]
    return [list(dict.fromkeys(f"{key.split('.')[-1]} {_short(one.get(key))}" for key in names)) for one in settings]


def _point(name: str, evaluation: Task) -> Series:
    """The curve that an evaluation belongs to, and its place on it."""
    about = prospect(evaluation.input("predictor"))
    if about.order is None:
        raise InvalidValueError(
            f"the figure '{name}' takes evaluations of EDMD predictors, which have an order, not of {about.name}"
        )
    test = evaluation.input("trajectories").ancestor("sample").settings
    inputs = INPUTS[test.excitation] if isinstance(test, (BoxSample, PointSample)) else test.kind
    return Series(f"{about.data}, {inputs}", about.order)


def _names(predictors: Sequence[Task]) -> list[str]:
    """What predictors are called; those of one name are told apart by the settings in which they differ."""
    names = [prospect(task).name for task in predictors]
    found = list(names)
    for name in dict.fromkeys(names):
        group = [i for i, other in enumerate(names) if other == name]
        for i, words in zip(group, _differing([dict(_settings(predictors[i])) for i in group]), strict=True):
            found[i] = ", ".join([name, *words])
    return found


def _settings(task: Task) -> Iterator[tuple[str, Any]]:
    """Every setting of a task and of what is behind it, by its full name."""
    for step in task.upstream():
        yield from ((f"{step.stage}.{key}", value) for key, value in flat(asdict(step.settings)))


def _short(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


TOLD: Mapping[str, Callable[[Experiment], Any]] = {
    "restart": lambda experiment: experiment.plot.restart,
    "tyres": recipes.tyres,
}
