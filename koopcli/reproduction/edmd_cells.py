"""What the EDMD experiment consists of: the sweep over orders, and the evaluations behind the paper's claims."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from koopcli.config.experiment import Experiment
from koopcli.config.paper import BEST_ORDERS
from koopcli.errors import InvalidValueError
from koopcli.koopman.edmd.fit import FitEdmd
from koopcli.simulation.samples.box import BoxSample
from koopcli.simulation.samples.grid import GridSample
from koopcli.simulation.samples.sample import Excitation
from koopcli.stages import recipes, verdict
from koopcli.stages.base import Task
from koopcli.stages.makers import outlook
from koopcli.vehicles.plants.forces import Forces

SWEEP, OTHERS, BASELINES, FORCES, PER_WHEEL, TEST_GRID, TEXTBOOK, DRAWN, DRAWS = (
    "sweep",
    "other bases",
    "baselines",
    "training forces",
    "force per wheel",
    "test states on a grid",
    "normal equations",
    "random inputs",
    "more draws",
)
BILINEAR_ORDER = 8  # of the yaw rate, beside degree 1 of the velocity: 27 functions
TEXTBOOK_ORDERS = (5, 6, 7)  # where the normal equations of monomials end
RESTART = 50  # samples, as in the paper's figure
SPLINES: str = "thin-plate"


@dataclass(frozen=True)
class Cell:
    """One predictor on one test set. ``block`` is what it belongs to, ``label`` what is special about it there."""

    block: str
    label: str
    draw: str
    order: int | None
    excitation: str


@dataclass(frozen=True)
class Training:
    """A training grid by its draw, and what it is called."""

    draw: str
    seed: int

    @property
    def name(self) -> str:
        """Its draw, with the seed where there is one to tell."""
        return f"{self.draw} {self.seed}" if self.draw == "random" else self.draw


def trainings(experiment: Experiment) -> list[Training]:
    """Every training grid of the sweep: each random one, and one of each other kind."""
    plan = experiment.reproduce
    found = []
    for draw in plan.draws:
        seeds = plan.draw_seeds if draw == "random" else plan.draw_seeds[:1]
        found += [Training(draw, seed) for seed in seeds]
    return found


def excitation(experiment: Experiment) -> Excitation:
    """The test inputs that claims are judged by: the kind the paper states, if it is swept."""
    plan = experiment.reproduce
    return "fresh" if "fresh" in plan.excitations else plan.excitations[0]


def best_order(experiment: Experiment) -> int:
    """The order that stands for polynomial bases: the paper's best, or the nearest below that is swept."""
    orders = experiment.reproduce.orders
    return max((order for order in orders if order <= BEST_ORDERS[-1]), default=orders[0])


def cells(experiment: Experiment) -> Iterator[tuple[Cell, Task]]:
    """Every cell of the experiment with its evaluation."""
    plan = experiment.reproduce
    basis = experiment.fit_edmd.basis
    if not hasattr(basis, "order"):
        raise InvalidValueError(
            f"reproduce edmd sweeps orders, which the basis '{basis.kind}' has none of: leave it out"
        )
    for training in trainings(experiment):
        for order in plan.orders:
            yield from _scored(experiment, SWEEP, "", training, recipes.with_order(experiment, order).fit_edmd)
    yield from _others(experiment)
    yield from _forces(experiment)
    yield from _settings(experiment)
    if plan.full:
        draws = [Training("random", seed) for seed in range(plan.full_draws)]
        for training in draws:
            for order in plan.orders:
                fit = recipes.with_order(experiment, order).fit_edmd
                yield from _scored(experiment, DRAWS, "", training, fit, (excitation(experiment),))


def bilinear(experiment: Experiment, terms: str) -> FitEdmd:
    """Bilinear terms on a constant and a linear velocity times powers of the yaw rate."""
    order = min(BILINEAR_ORDER, grid(experiment).count - 1)
    return FitEdmd.of(basis="anisotropic", order=order, terms=terms)


def splines(experiment: Experiment) -> FitEdmd:
    """Thin-plate splines, with the experiment's centres."""
    return FitEdmd(experiment.fit("fit-edmd", basis=SPLINES).basis)


def compared(experiment: Experiment) -> list[Task]:
    """Evaluations on one test set: the best order, what is set beside it, and the linearised plant."""
    first = trainings(experiment)[0]
    data = training_set(experiment, first)
    fits = [
        recipes.with_order(experiment, best_order(experiment)).fit_edmd,
        splines(experiment),
        bilinear(experiment, "bilinear"),
        bilinear(experiment, "generator"),
    ]
    predictors = [recipes.fit_edmd(replace(experiment, fit_edmd=fit), data) for fit in fits]
    tasks = [_evaluated(experiment, predictor, excitation(experiment)) for predictor in predictors]
    return [*tasks, verdict.beside(experiment, tasks[0])["linearisation"]]


def _others(experiment: Experiment) -> Iterator[tuple[Cell, Task]]:
    """Splines, bilinear terms and baselines, on a random and on another training grid."""
    everywhere = trainings(experiment)
    for training in dict.fromkeys((everywhere[0], everywhere[-1])):
        for fit in (splines(experiment), bilinear(experiment, "bilinear"), bilinear(experiment, "generator")):
            yield from _scored(experiment, OTHERS, None, training, fit)
    first = everywhere[0]
    for cell, task in _scored(experiment, SWEEP, "", first, experiment.fit_edmd):
        for name, other in verdict.beside(experiment, task).items():
            yield Cell(BASELINES, verdict.NAMES[name], first.name, None, cell.excitation), other


def _forces(experiment: Experiment) -> Iterator[tuple[Cell, Task]]:
    """The best order trained with forces of one size, and one bilinear row, whose regression needs them no smaller."""
    first, sample = trainings(experiment)[0], grid(experiment)
    columns = len(sample.levels) * sample.columns
    best = recipes.with_order(experiment, best_order(experiment)).fit_edmd
    for level in experiment.reproduce.training_forces:
        for fit in (best, bilinear(experiment, "bilinear")):
            label = f"{outlook_name(experiment, fit)}, ±{level:g} N"
            yield from _scored(experiment, FORCES, label, first, fit, levels=(level,), columns=columns)


def _settings(experiment: Experiment) -> Iterator[tuple[Cell, Task]]:
    """Assumptions the paper leaves open, and how the textbook's regression fares."""
    first = trainings(experiment)[0]
    best = recipes.with_order(experiment, best_order(experiment)).fit_edmd
    plant = experiment.plant_for(Forces)
    assert isinstance(plant, Forces)
    other = Forces("axle" if plant.force_per == "wheel" else "wheel")
    elsewhere = replace(experiment, simulate=replace(experiment.simulate, plant=other))
    yield from _scored(elsewhere, PER_WHEEL, f"force per {other.force_per}", first, best)
    data = training_set(experiment, first)
    predictor = recipes.fit_edmd(replace(experiment, fit_edmd=best), data)
    side = round(box(experiment).count ** (1 / 3))
    for kind in experiment.reproduce.excitations:
        task = _evaluated(experiment, predictor, kind, layout="product", count=side**3)
        yield Cell(TEST_GRID, f"{side}³ test states on a grid", first.name, _order(best), kind), task
    for order in (order for order in TEXTBOOK_ORDERS if order in experiment.reproduce.orders):
        fit = FitEdmd.of(order=order, solver="cholesky-monomials")
        yield from _scored(experiment, TEXTBOOK, "cholesky-monomials", first, fit, (excitation(experiment),))
    restarting = replace(experiment, evaluate=replace(experiment.evaluate, restart=RESTART))
    for fit in (best, bilinear(experiment, "bilinear"), bilinear(experiment, "generator")):
        predictor = recipes.fit_edmd(replace(experiment, fit_edmd=fit), data)
        task = recipes.evaluation(restarting, predictor)
        label = f"{outlook(predictor).name}, restart every {RESTART}"
        yield Cell(DRAWN, label, first.name, _order(fit), "fresh"), task


def outlook_name(experiment: Experiment, fit: FitEdmd) -> str:
    """What the predictor of a fit is called."""
    return outlook(recipes.fit_edmd(replace(experiment, fit_edmd=fit))).name


def _scored(
    experiment: Experiment,
    block: str,
    label: str | None,
    training: Training,
    fit: FitEdmd,
    excitations: tuple[Excitation, ...] = (),
    **changed: object,
) -> Iterator[tuple[Cell, Task]]:
    """One fit under each kind of test inputs; its own name is the label where there is none."""
    predictor = recipes.fit_edmd(replace(experiment, fit_edmd=fit), training_set(experiment, training, **changed))
    named = outlook(predictor).name if label is None else label
    for kind in excitations or experiment.reproduce.excitations:
        yield Cell(block, named, training.name, _order(fit), kind), _evaluated(experiment, predictor, kind)


def _order(fit: FitEdmd) -> int | None:
    return getattr(fit.basis, "order", None)


def training_set(experiment: Experiment, training: Training, **changed: object) -> Task:
    """The trajectories of a training grid, with settings of its sample ``changed``."""
    sample = replace(grid(experiment), draw=training.draw, seed=training.seed, **changed)  # type: ignore[arg-type]
    return recipes.simulation(experiment, recipes.sample(sample))


def _evaluated(experiment: Experiment, predictor: Task, kind: Excitation, **changed: object) -> Task:
    plant = predictor.ancestor("simulate").settings
    return recipes.evaluation(experiment, predictor, recipes.test_set(experiment, plant, excitation=kind, **changed))


def grid(experiment: Experiment) -> GridSample:
    """The training sample. Raises ``InvalidValueError`` for another kind."""
    found = experiment.sample("grid")
    if not isinstance(found, GridSample):
        raise InvalidValueError("reproduce edmd trains on a grid: sample.kind must be 'grid'")
    return found


def box(experiment: Experiment) -> BoxSample:
    """The test states. Raises ``InvalidValueError`` for another kind."""
    found = experiment.test("box", experiment.vehicle)
    if not isinstance(found, BoxSample):
        raise InvalidValueError("reproduce edmd tests on states in a box: test.kind must be 'box'")
    return found
