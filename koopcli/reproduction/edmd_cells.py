"""What the EDMD experiment consists of: the sweep over orders, and the evaluations behind the paper's claims."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Literal

from koopcli.config.experiment import Experiment
from koopcli.config.paper import BEST_ORDERS
from koopcli.errors import InvalidValueError
from koopcli.koopman.edmd.fit import FitEdmd
from koopcli.simulation.samples.box import BoxSample
from koopcli.simulation.samples.grid import GridSample
from koopcli.simulation.samples.sample import Excitation
from koopcli.stages import recipes, verdict
from koopcli.stages.base import Task
from koopcli.stages.fits import outlook
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
BESIDE = (OTHERS, BASELINES, FORCES, PER_WHEEL, TEST_GRID, TEXTBOOK, DRAWN)  # all but sweeps
BILINEAR_ORDER = 8  # of the yaw rate, beside degree 1 of the velocity: 27 functions
TEXTBOOK_ORDERS = (5, 6, 7)  # where the normal equations of monomials end
RESTART = 50  # samples, as in the paper's figure
SPLINES: str = "thin-plate"


@dataclass(frozen=True)
class EdmdCell:
    """One predictor on one test set. ``block`` is what it belongs to, ``label`` what is special about it there."""

    block: str
    label: str
    draw: str
    order: int | None
    excitation: str


@dataclass(frozen=True)
class Training:
    """A training grid by its draw; ``force``: all its inputs are of this size in N, and as many."""

    draw: Literal["random", "even", "chebyshev"]
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


@dataclass(frozen=True)
class Edmd:
    """What an ``experiment`` has of the method: its training grids, its fits, and the evaluations of both."""

    experiment: Experiment

    @cached_property
    def trainings(self) -> list[Training]:
        """Every training grid of the sweep: each random one, and one of each other kind."""
        plan = self.experiment.reproduce
        seeds = {draw: plan.draw_seeds if draw == "random" else plan.draw_seeds[:1] for draw in plan.draws}
        return [Training(draw, seed) for draw in plan.draws for seed in seeds[draw]]

    @property
    def first(self) -> Training:
        """The training grid of everything that is fitted on one alone."""
        return self.trainings[0]

    @property
    def both(self) -> list[Training]:
        """The training grids that other bases are fitted to as well: a random one and another, by default."""
        return list(dict.fromkeys((self.trainings[0], self.trainings[-1])))

    @property
    def many(self) -> list[Training]:
        """The many random training grids of a full run."""
        plan = self.experiment.reproduce
        return [Training("random", seed) for seed in range(plan.full_draws)] if plan.full else []

    @property
    def inputs(self) -> Excitation:
        """The test inputs that claims are judged by: the kind the paper states, if it is swept."""
        kinds = self.experiment.reproduce.excitations
        return "fresh" if "fresh" in kinds else kinds[0]

    @property
    def order(self) -> int:
        """The order that stands for polynomial bases: the paper's best, or the nearest below that is swept."""
        orders = self.experiment.reproduce.orders
        return max((order for order in orders if order <= BEST_ORDERS[-1]), default=orders[0])

    @property
    def polynomials(self) -> dict[int, FitEdmd]:
        """The experiment's fit with every order of the sweep."""
        return {order: self.with_order(order) for order in self.experiment.reproduce.orders}

    @property
    def best(self) -> FitEdmd:
        """The fit that stands for polynomial bases."""
        return self.with_order(self.order)

    @property
    def bilinear(self) -> FitEdmd:
        """Bilinear terms on a constant and a linear velocity times powers of the yaw rate."""
        return FitEdmd.of(basis="anisotropic", order=min(BILINEAR_ORDER, self.grid.count - 1), terms="bilinear")

    @property
    def generator(self) -> FitEdmd:
        """The same in continuous time."""
        return self.bilinear.but(terms="generator")

    @property
    def splines(self) -> FitEdmd:
        """Thin-plate splines, with the experiment's centres."""
        return FitEdmd(self.experiment.fit("fit-edmd", basis=SPLINES).basis)

    @property
    def textbook(self) -> dict[int, FitEdmd]:
        """The textbook's regression, of those of its orders that are swept."""
        orders = [order for order in TEXTBOOK_ORDERS if order in self.experiment.reproduce.orders]
        return {order: FitEdmd.of(order=order, solver="cholesky-monomials") for order in orders}

    def with_order(self, order: int) -> FitEdmd:
        """The experiment's fit with an order."""
        return recipes.with_order(self.experiment, order).fit_edmd

    def trained(self, training: Training, fit: FitEdmd) -> Task:
        """The predictor of a fit on a training grid."""
        trajectories = recipes.simulation(self.experiment, recipes.sample(training.of(self.grid)))
        return recipes.fit_edmd(replace(self.experiment, fit_edmd=fit), trajectories)

    def evaluated(self, training: Training, fit: FitEdmd, kind: Excitation | None = None, **tested: object) -> Task:
        """Its evaluation under a kind of test inputs, those that claims are judged by if none are said; ``tested``:
        settings of the test sample to replace.
        """
        predictor = self.trained(training, fit)
        plant = predictor.ancestor("simulate").settings
        test = recipes.test_set(self.experiment, plant, excitation=kind or self.inputs, **tested)
        return recipes.evaluation(self.experiment, predictor, test)

    @property
    def grid(self) -> GridSample:
        """The training sample. Raises ``InvalidValueError`` for another kind."""
        sample = self.experiment.sample("grid")
        if not isinstance(sample, GridSample):
            raise InvalidValueError("reproduce edmd trains on a grid: sample.kind must be 'grid'")
        return sample

    @property
    def box(self) -> BoxSample:
        """The test states. Raises ``InvalidValueError`` for another kind."""
        sample = self.experiment.test("box", self.experiment.vehicle)
        if not isinstance(sample, BoxSample):
            raise InvalidValueError("reproduce edmd tests on states in a box: test.kind must be 'box'")
        return sample


def cells(experiment: Experiment) -> Iterator[tuple[EdmdCell, Task]]:
    """Every cell of the experiment with its evaluation."""
    basis = experiment.fit_edmd.basis
    if not hasattr(basis, "order"):
        raise InvalidValueError(
            f"reproduce edmd sweeps orders, which the basis '{basis.kind}' has none of: leave it out"
        )
    edmd = Edmd(experiment)
    for training, fit in product(edmd.trainings, edmd.polynomials.values()):
        yield from _row(edmd, SWEEP, "", training, fit)
    yield from _others(edmd)
    yield from _settings(edmd)
    for training, fit in product(edmd.many, edmd.polynomials.values()):
        yield from _row(edmd, DRAWS, "", training, fit, [edmd.inputs])


def _others(edmd: Edmd) -> Iterator[tuple[EdmdCell, Task]]:
    """Splines, bilinear terms and baselines, and the best order trained with forces of one size, beside one bilinear
    row, whose regression needs them no smaller.
    """
    plan, first = edmd.experiment.reproduce, edmd.first
    for training, fit in product(edmd.both, (edmd.splines, edmd.bilinear, edmd.generator)):
        yield from _row(edmd, OTHERS, "{name}", training, fit)
    for kind in plan.excitations:
        own = edmd.evaluated(first, edmd.experiment.fit_edmd, kind)
        for name, task in verdict.beside(edmd.experiment, own).items():
            yield EdmdCell(BASELINES, verdict.NAMES[name], first.name, None, kind), task
    for force, fit in product(plan.training_forces, (edmd.best, edmd.bilinear)):
        yield from _row(edmd, FORCES, f"{{name}}, ±{force:g} N", replace(first, force=force), fit)


def _settings(edmd: Edmd) -> Iterator[tuple[EdmdCell, Task]]:
    """Assumptions the paper leaves open, and how the textbook's regression fares."""
    experiment, first = edmd.experiment, edmd.first
    forces = Forces("axle" if experiment.plant_for(Forces) == Forces("wheel") else "wheel")
    elsewhere = Edmd(replace(experiment, simulate=replace(experiment.simulate, plant=forces)))
    yield from _row(elsewhere, PER_WHEEL, f"force per {forces.force_per}", first, edmd.best)
    side = round(edmd.box.count ** (1 / 3))
    label = f"{side}³ test states on a grid"
    yield from _row(edmd, TEST_GRID, label, first, edmd.best, layout="product", count=side**3)
    for fit in edmd.textbook.values():
        yield from _row(edmd, TEXTBOOK, "cholesky-monomials", first, fit, [edmd.inputs])
    restarting = replace(experiment, evaluate=replace(experiment.evaluate, restart=RESTART))
    for fit in (edmd.best, edmd.bilinear, edmd.generator):
        predictor = edmd.trained(first, fit)
        cell = _cell(DRAWN, f"{{name}}, restart every {RESTART}", first, predictor, "fresh")
        yield cell, recipes.evaluation(restarting, predictor)


def _row(
    edmd: Edmd,
    block: str,
    label: str,
    training: Training,
    fit: FitEdmd,
    kinds: Sequence[Excitation] = (),
    **tested: object,
) -> Iterator[tuple[EdmdCell, Task]]:
    """One fit under each kind of test inputs; ``{name}`` in its label is what it is called."""
    for kind in kinds or edmd.experiment.reproduce.excitations:
        task = edmd.evaluated(training, fit, kind, **tested)
        yield _cell(block, label, training, task.input("predictor"), kind), task


def _cell(block: str, label: str, training: Training, predictor: Task, kind: Excitation) -> EdmdCell:
    about = outlook(predictor)
    return EdmdCell(block, label.format(name=about.name), training.name, about.order, kind)
