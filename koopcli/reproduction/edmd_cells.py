"""What the EDMD experiment consists of: the sweep over orders, and the evaluations behind the paper's claims."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from koopcli.config.experiment import Experiment
from koopcli.config.paper import BEST_ORDERS
from koopcli.config.sampled import Draw, Excitation
from koopcli.config.samples import BoxSample, GridSample
from koopcli.config.settings import OF_BASIS, BasisName, FitEdmd, ForcePer, Terms
from koopcli.errors import InvalidValueError
from koopcli.stages import recipes, verdict
from koopcli.stages.base import Task
from koopcli.stages.makers import outlook

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
SPLINES: BasisName = "thin-plate"


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
    """A training grid by its draw; ``force``: all its inputs are of this size in N, and as many."""

    draw: Draw
    seed: int
    force: float | None = None

    @property
    def name(self) -> str:
        """Its draw, with the seed where there is one to tell."""
        return f"{self.draw} {self.seed}" if self.draw == "random" else self.draw

    def of(self, own: GridSample) -> GridSample:
        """The sample, where the experiment's ``own`` has everything else."""
        sample = replace(own, draw=self.draw, seed=self.seed)
        if self.force is None:
            return sample
        return replace(sample, levels=(self.force,), columns=len(own.levels) * own.columns)


def cells(experiment: Experiment) -> Iterator[tuple[Cell, Task]]:
    """Every cell of the experiment with its evaluation."""
    if "order" not in OF_BASIS[experiment.fit_edmd.basis]:
        raise InvalidValueError(
            f"reproduce edmd sweeps orders, which the basis '{experiment.fit_edmd.basis}' has none of: leave it out"
        )
    for training in trainings(experiment):
        for order in experiment.reproduce.orders:
            yield from _row(experiment, SWEEP, "", training, polynomials(experiment, order))
    yield from _others(experiment)
    yield from _settings(experiment)
    for training in more_trainings(experiment):
        for order in experiment.reproduce.orders:
            main = (excitation(experiment),)
            yield from _row(experiment, DRAWS, "", training, polynomials(experiment, order), main)


def _others(experiment: Experiment) -> Iterator[tuple[Cell, Task]]:
    """Splines, bilinear terms and baselines, and the best order trained with forces of one size, beside one bilinear
    row, whose regression needs them no smaller.
    """
    first = trainings(experiment)[0]
    for training in compared_on(experiment):
        for fit in (splines(experiment), *bilinears(experiment)):
            yield from _row(experiment, OTHERS, name(experiment, fit), training, fit)
    for kind in experiment.reproduce.excitations:
        own = evaluated(experiment, first, experiment.fit_edmd, kind)
        for beside, task in verdict.beside(experiment, own).items():
            yield Cell(BASELINES, verdict.NAMES[beside], first.name, None, kind), task
    for force in experiment.reproduce.training_forces:
        for fit in (polynomials(experiment), bilinear(experiment, "bilinear")):
            label = f"{name(experiment, fit)}, ±{force:g} N"
            yield from _row(experiment, FORCES, label, replace(first, force=force), fit)


def _settings(experiment: Experiment) -> Iterator[tuple[Cell, Task]]:
    """Assumptions the paper leaves open, and how the textbook's regression fares."""
    first, best, main = trainings(experiment)[0], polynomials(experiment), excitation(experiment)
    other: ForcePer = "axle" if experiment.simulate.force_per == "wheel" else "wheel"
    elsewhere = replace(experiment, simulate=replace(experiment.simulate, force_per=other))
    yield from _row(elsewhere, PER_WHEEL, f"force per {other}", first, best)
    side = round(box(experiment).count ** (1 / 3))
    label = f"{side}³ test states on a grid"
    yield from _row(experiment, TEST_GRID, label, first, best, layout="product", count=side**3)
    for fit in textbook(experiment).values():
        yield from _row(experiment, TEXTBOOK, "cholesky-monomials", first, fit, (main,))
    restarting = replace(experiment, evaluate=replace(experiment.evaluate, restart=RESTART))
    for fit in (best, *bilinears(experiment)):
        predictor = trained(experiment, first, fit)
        label = f"{outlook(predictor).name}, restart every {RESTART}"
        yield (
            Cell(DRAWN, label, first.name, outlook(predictor).order, "fresh"),
            recipes.evaluation(restarting, predictor),
        )


def _row(
    experiment: Experiment,
    block: str,
    label: str,
    training: Training,
    fit: FitEdmd,
    excitations: Sequence[Excitation] = (),
    **tested: object,
) -> Iterator[tuple[Cell, Task]]:
    """One fit under each kind of test inputs."""
    predictor = trained(experiment, training, fit)
    order = outlook(predictor).order
    for kind in excitations or experiment.reproduce.excitations:
        yield Cell(block, label, training.name, order, kind), _tested(experiment, predictor, kind, **tested)


def evaluated(experiment: Experiment, training: Training, fit: FitEdmd, kind: Excitation) -> Task:
    """The evaluation of a fit of a training grid under one kind of test inputs."""
    return _tested(experiment, trained(experiment, training, fit), kind)


def sweep(experiment: Experiment, training: Training, kind: Excitation) -> dict[int, Task]:
    """The evaluation of every order on a training grid under one kind of test inputs."""
    orders = experiment.reproduce.orders
    return {order: evaluated(experiment, training, polynomials(experiment, order), kind) for order in orders}


def trained(experiment: Experiment, training: Training, fit: FitEdmd) -> Task:
    """The predictor of a fit of a training grid."""
    sample = recipes.sample(training.of(grid(experiment)))
    return fitted(experiment, fit, recipes.simulation(experiment, sample))


def fitted(experiment: Experiment, fit: FitEdmd, *trajectories: Task) -> Task:
    """The predictor of a fit, of the experiment's training set or of the trajectories given."""
    return recipes.fit_edmd(replace(experiment, fit_edmd=fit), *trajectories)


def _tested(experiment: Experiment, predictor: Task, kind: Excitation, **changed: object) -> Task:
    plant = predictor.ancestor("simulate").settings
    return recipes.evaluation(experiment, predictor, recipes.test_set(experiment, plant, excitation=kind, **changed))


def trainings(experiment: Experiment) -> list[Training]:
    """Every training grid of the sweep: each random one, and one of each other kind."""
    plan = experiment.reproduce
    return [
        Training(draw, seed)
        for draw in plan.draws
        for seed in (plan.draw_seeds if draw == "random" else plan.draw_seeds[:1])
    ]


def compared_on(experiment: Experiment) -> list[Training]:
    """The training grids that other bases are fitted to as well: a random one and another, by default."""
    everywhere = trainings(experiment)
    return list(dict.fromkeys((everywhere[0], everywhere[-1])))


def more_trainings(experiment: Experiment) -> list[Training]:
    """The many random training grids of a full run."""
    plan = experiment.reproduce
    return [Training("random", seed) for seed in range(plan.full_draws)] if plan.full else []


def excitation(experiment: Experiment) -> Excitation:
    """The test inputs that claims are judged by: the kind the paper states, if it is swept."""
    plan = experiment.reproduce
    return "fresh" if "fresh" in plan.excitations else plan.excitations[0]


def best_order(experiment: Experiment) -> int:
    """The order that stands for polynomial bases: the paper's best, or the nearest below that is swept."""
    orders = experiment.reproduce.orders
    return max((order for order in orders if order <= BEST_ORDERS[-1]), default=orders[0])


def polynomials(experiment: Experiment, order: int | None = None) -> FitEdmd:
    """The experiment's fit with an order, without one with that which stands for polynomial bases."""
    return recipes.with_order(experiment, best_order(experiment) if order is None else order).fit_edmd


def bilinear(experiment: Experiment, terms: Terms) -> FitEdmd:
    """Bilinear terms on a constant and a linear velocity times powers of the yaw rate."""
    order = min(BILINEAR_ORDER, grid(experiment).count - 1)
    return FitEdmd(basis="anisotropic", order=order, terms=terms)


def bilinears(experiment: Experiment) -> tuple[FitEdmd, FitEdmd]:
    """Bilinear terms by a step, and by their generator."""
    return bilinear(experiment, "bilinear"), bilinear(experiment, "generator")


def splines(experiment: Experiment) -> FitEdmd:
    """Thin-plate splines, with the experiment's centres."""
    given = experiment.fit_edmd
    return FitEdmd(basis=SPLINES, centres=given.centres, placement=given.placement, seed=given.seed)


def textbook(experiment: Experiment) -> dict[int, FitEdmd]:
    """The textbook's regression, of those of its orders that are swept."""
    orders = (order for order in TEXTBOOK_ORDERS if order in experiment.reproduce.orders)
    return {order: FitEdmd(order=order, solver="cholesky-monomials") for order in orders}


def name(experiment: Experiment, fit: FitEdmd) -> str:
    """What the predictor of a fit is called."""
    return outlook(fitted(experiment, fit)).name


def grid(experiment: Experiment) -> GridSample:
    """The training sample. Raises ``InvalidValueError`` for another kind."""
    sample = experiment.sample("grid")
    if not isinstance(sample, GridSample):
        raise InvalidValueError("reproduce edmd trains on a grid: sample.kind must be 'grid'")
    return sample


def box(experiment: Experiment) -> BoxSample:
    """The test states. Raises ``InvalidValueError`` for another kind."""
    sample = experiment.test("box", experiment.vehicle)
    if not isinstance(sample, BoxSample):
        raise InvalidValueError("reproduce edmd tests on states in a box: test.kind must be 'box'")
    return sample
