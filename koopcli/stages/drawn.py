"""From artefacts to a figure: which it takes, what they are called in it, and which it makes when none is named."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from koopcli.checks import build
from koopcli.config.experiment import Experiment
from koopcli.config.pictures import Cone, ImageFormat, Plot, Series
from koopcli.config.settings import FitName, Simulate
from koopcli.errors import InvalidValueError, UnknownNameError
from koopcli.figures import source_digest
from koopcli.figures.registry import FIGURES, FigureKind
from koopcli.simulation.manoeuvres import MANOEUVRES
from koopcli.simulation.samples.manoeuvre import ManoeuvreSample
from koopcli.simulation.samples.point import PointSample
from koopcli.stages import grid, recipes
from koopcli.stages.base import Task
from koopcli.stages.makers import LIFTED, MAKERS
from koopcli.stages.naming import names, points
from koopcli.stages.subject import of_tyres, subject

TAKES: dict[str, tuple[str, ...]] = {
    "evaluation": ("evaluate",),
    "predictor": tuple(MAKERS),
    "fit": LIFTED,
    "sample": ("sample",),
    "trajectories": ("simulate",),
    "sweep": ("sweep",),
    "nothing": (),
}
TOLD_BESIDE = ("test", "plot")  # sections that matter beside a named predictor


@dataclass(frozen=True)
class Made:
    """What a figure makes when nothing is named."""

    recipe: Callable[[Experiment], list[Task]]
    """The artefacts that it draws."""
    fit: FitName | None = None
    """The fit that it makes, if any, unless the experiment is about the other one and the figure follows that."""
    follows: bool = False
    """Whether it can be drawn for either fit."""
    reads: tuple[str, ...] = ()
    """Beginnings of settings that matter beside those of the tasks."""
    fixed: tuple[str, ...] = ()
    """Beginnings of settings that the figure chooses itself."""
    instead: str = ""
    """What to do instead of changing those."""

    def tasks(self, experiment: Experiment) -> list[Task]:
        """The artefacts that it draws. Raises ``InvalidValueError`` for an experiment about a fit it is not for."""
        about = experiment.about.fit
        if self.fit is not None and not self.follows and about not in (None, self.fit):
            raise InvalidValueError(
                f"the figure makes {self.fit} predictors, the experiment is about {about}: name what to draw, or add "
                f"--set experiment.fit={self.fit}"
            )
        return self.recipe(experiment)

    def chooses(self, name: str, experiment: Experiment) -> bool:
        """Whether the figure chooses the setting ``name`` itself; a figure that follows leaves the fit open."""
        own = f"{experiment.about.fit or self.fit}."
        return f"{name}.".startswith(self.fixed) and not (self.follows and name.startswith(own))


MADE: dict[str, Made] = {
    "orders": Made(
        recipes.order_sweep,
        fit="fit-edmd",
        reads=("reproduce.orders",),
        fixed=("fit-edmd.order", "reproduce.draw", "reproduce.excitations"),
        instead="it sweeps reproduce.orders with sample.draw and test.excitation",
    ),
    "draws": Made(
        recipes.draw_sweep,
        fit="fit-edmd",
        reads=("reproduce.orders", "reproduce.full_draws"),
        fixed=("fit-edmd.order", "sample.seed", "sample.grid.seed", "reproduce.draw"),
        instead="it sweeps reproduce.orders over reproduce.full_draws random grids",
    ),
    "sweep": Made(
        lambda experiment: [grid.order_grid(experiment)],
        fit="fit-edmd",
        reads=("reproduce.orders", "reproduce.draw_seeds"),
        fixed=("fit-edmd.order", "sample.seed", "sample.grid.seed", "reproduce.draws"),
        instead="it sweeps reproduce.orders over reproduce.draw_seeds; koop sweep sweeps anything",
    ),
    "eigen": Made(
        lambda experiment: [recipes.evaluation(experiment, recipes.predictor(experiment, "fit-eigen"))],
        fit="fit-eigen",
        follows=True,
    ),
    "beside": Made(
        recipes.side_by_side,
        fit="fit-eigen",
        follows=True,
        fixed=("fit-edmd.", "baseline."),
        instead="it sets one predictor beside fixed baselines and EDMD fits; name evaluations to choose others",
    ),
    "improved": Made(
        lambda experiment: [recipes.evaluation(experiment, fit) for fit in recipes.improved(experiment)],
        fit="fit-eigen",
        reads=("reproduce.budgets",),
        fixed=("fit-eigen.",),
        instead="it sets the paper's reading beside the experiment best-eigen; name evaluations to choose others",
    ),
    "trusted": Made(
        lambda experiment: [recipes.evaluation(experiment, recipes.improved(experiment)[-1])],
        fit="fit-eigen",
        reads=("reproduce.budgets",),
        fixed=("fit-eigen.", "sample."),
        instead="it draws the experiment best-eigen; name an evaluation to choose another",
    ),
    "modes": Made(
        recipes.mode_sweep,
        fit="fit-eigen",
        reads=("reproduce.pairs",),
        fixed=("fit-eigen.eigenvalues", "fit-eigen.pairs", "fit-eigen.degree"),
        instead="it sweeps the degree of the lattice and reproduce.pairs",
    ),
    "budgets": Made(
        recipes.budget_sweep,
        fit="fit-eigen",
        reads=("reproduce.budgets", "reproduce.beside"),
        fixed=("fit-eigen.", "sample."),
        instead="it draws the experiment best-eigen on reproduce.budgets; name evaluations to choose others",
    ),
    "edmd-fit": Made(lambda experiment: [recipes.predictor(experiment)], fit="fit-edmd", follows=True),
    "surface": Made(lambda experiment: [recipes.sample(experiment.sample("ellipsoid"))]),
    "manoeuvre": Made(
        lambda experiment: [recipes.simulation(experiment, recipes.sample(experiment.sample("manoeuvre")))]
    ),
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
    told = {field: TOLD[field](experiment, artefacts) for field in kind.told}
    of = of_tyres(experiment) if "tyres" in kind.told else subject(artefacts, simulated)
    about = {"figure": name, "format": image, "drawn_by": source_digest(), "of": of}
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
    if kind.draws == "beside":
        for other in artefacts[1:]:
            _check_shared(name, artefacts[0], other)


def _check_plant(name: str, predictor: Task, simulation: Simulate) -> None:
    """Refuse a predictor of a plant that the trajectory made for the figure cannot drive."""
    meant = PointSample.meant_for
    plant = simulation.plant
    assert plant is not None, "settled when it was simulated"
    if plant.inputs != meant.inputs:
        raise InvalidValueError(
            f"the figure '{name}' takes predictors of the plant '{meant.kind}', {predictor.name} is of '{plant.kind}'"
        )


def _check_shared(name: str, one: Task, other: Task) -> None:
    """Refuse two evaluations that did not score the same samples of the same trajectories."""
    here, there = one.input("trajectories"), other.input("trajectories")
    if here.settings.plant != there.settings.plant:
        raise InvalidValueError(
            f"{one.name} is of the plant '{here.settings.plant.kind}', {other.name} of '{there.settings.plant.kind}': the figure "
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
    else:
        series = tuple(Series(label) for label in names([task.input("predictor") for task in artefacts]))
    for one in series:
        if series.count(one) > 1:
            what = one.label if one.at is None else f"{kind.against} {one.at:g}, {one.label}"
            raise InvalidValueError(f"several evaluations of {what}: name each once, and those of one experiment")
    return series


def _cones(artefacts: Sequence[Task]) -> tuple[Cone, ...]:
    """Those of the manoeuvre that the trajectories drive, where it has any; to the other side for a negative scale."""
    driven = [sample.settings for task in artefacts if (sample := task.find("sample")) is not None]
    manoeuvres = [one for one in driven if isinstance(one, ManoeuvreSample)]
    return tuple(Cone(X, Y if one.scale >= 0 else -Y) for one in manoeuvres for X, Y in MANOEUVRES[one.name].cones)


TOLD: Mapping[str, Callable[[Experiment, Sequence[Task]], Any]] = {
    "restart": lambda experiment, artefacts: experiment.plot.restart,
    "trajectory": lambda experiment, artefacts: experiment.plot.trajectory,
    "cones": lambda experiment, artefacts: _cones(artefacts),
    "tyres": lambda experiment, artefacts: recipes.tyres(experiment),
}  # fields of ``Plot`` that figures are told
