"""What goes beyond the paper: its surface with better rates and lifts, other designs of Γ, and one ingredient less."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product

from koopcli.config.experiment import Experiment
from koopcli.errors import InvalidValueError
from koopcli.koopman.bases.thin_plate import Splines
from koopcli.koopman.edmd.fit import FitEdmd
from koopcli.koopman.eigen.fit import FitEigen
from koopcli.koopman.eigen.rates.rates import Rates
from koopcli.reproduction.eigen_cells import CUT, surface
from koopcli.simulation.samples.ellipsoid import EllipsoidSample
from koopcli.simulation.samples.greedy import GreedySample
from koopcli.simulation.samples.sample import SampleChoice
from koopcli.stages import recipes
from koopcli.stages.base import Task

SHELLS, SHELL_STEPS, SHELL_TABLE = 6, 80, 0.3  # of the design by shells; s
TABLE, HORIZON = 0.5, 0.5  # s, of trajectories of one second
THINNED = 20  # nodes of each trajectory, where neighbours are not chosen apart
LADDER, BUDGETS, EDMD, ABLATION, UNSEEN, MODES = "ladder", "budgets", "edmd", "ablation", "unseen", "modes"
BESIDE = (
    FitEdmd.of(basis="total", order=7),
    FitEdmd.of(basis="thin-plate", centres=300),
    FitEdmd.of(basis="total", order=9),
)  # EDMD of the same trajectories
STACKED = 5  # which rung of the ladder has shells
STATES = 3  # of the plant on tyres


@dataclass(frozen=True)
class Cell:
    """One predictor on the test states of one seed. ``block`` is the table it stands in, ``design`` its initial states
    and ``simulated`` the seconds of its trajectories; ``modes``: how many rates it has, where they are swept.
    """

    block: str
    label: str
    design: str
    simulated: float
    vehicle: str
    seed: int
    modes: int = 0


@dataclass(frozen=True)
class Row:
    """A predictor before it is put to a vehicle and to test states: initial ``states``, and its ``fit``."""

    label: str
    design: str
    states: SampleChoice
    fit: FitEigen | FitEdmd


AHEAD = FitEigen.of(window="horizon", eigenvalues="comb", cut=CUT, tabulate=TABLE, horizon=HORIZON)


def cells(experiment: Experiment) -> Iterator[tuple[Cell, Task]]:
    """Every cell with its evaluation."""
    plan = experiment.reproduce
    everywhere, first = recipes.vehicles(experiment), plan.seeds[0]
    for (vehicle, there), seed in product(everywhere, plan.seeds[:2]):
        for row in ladder(there):
            yield _cell(LADDER, row, there, vehicle, seed)
        for row in budgets(there):
            yield _cell(BUDGETS, row, there, vehicle, seed)
        for row in beside(there):
            yield _cell(EDMD, row, there, vehicle, seed)
    for vehicle, there in everywhere:
        for row in ablation(there):
            yield _cell(ABLATION, row, there, vehicle, first)
        for modes, row in sweep(there):
            cell, task = _cell(MODES, row, there, vehicle, first)
            yield replace(cell, modes=modes), task
    for vehicle, there in unseen(experiment):
        for seed in plan.seeds[:2]:
            yield _cell(UNSEEN, _best_row(there), there, vehicle, seed)


def ladder(there: Experiment) -> Iterator[Row]:
    """From the paper's reading to the best predictor, an ingredient at a time."""
    gamma, shells = surface(there), f"{SHELLS} shells"
    paper = FitEigen.of(boundary="optimal", cut=CUT, tabulate=there.fit_eigen.tabulate)
    comb = replace(paper, eigenvalues="comb")
    yield Row("lattice of rates, nearest sample", "surface", gamma, paper)
    yield Row("lattice of rates, linear", "surface", gamma, replace(paper, lift="linear"))
    yield Row("comb of rates, nearest sample", "surface", gamma, comb)
    yield Row(f"{_count('varpro')} best rates, nearest sample", "surface", gamma, replace(paper, eigenvalues="varpro"))
    yield Row("comb of rates, linear", "surface", gamma, replace(comb, lift="linear"))
    stacked = replace(gamma, shells=SHELLS, steps=SHELL_STEPS)
    ahead = replace(AHEAD, tabulate=SHELL_TABLE, lift="linear")
    yield Row("comb, linear", f"{shells}, spiral", replace(stacked, mesh="fibonacci"), ahead)
    yield Row("comb, linear", f"{shells}, mesh", replace(stacked, mesh="sphere"), ahead)
    filled = greedy(there, plain=True)
    linear, spline = replace(AHEAD, lift="linear"), replace(AHEAD, lift="polyharmonic", nodes=THINNED)
    yield Row("comb, linear", "greedy", filled, linear)
    yield Row("comb, splines", "greedy", filled, spline)
    yield Row("comb, linear, world", "greedy", filled, replace(linear, coordinates="world"))
    world = replace(spline, coordinates="world")
    yield Row("comb, splines, world", "greedy", filled, world)
    mirrored = greedy(there)
    world = replace(world, mirror=mirrored.mirror)
    yield Row("the same with images", "greedy, images", mirrored, world)
    best = best_fit(there)
    spread = replace(world, radial_power=best.radial_power, spacing=best.spacing, nodes=None)
    yield Row("and distances, neighbours", "greedy, images", mirrored, spread)
    yield _best_row(there)


def _best_row(there: Experiment) -> Row:
    return Row("and continuation: best-eigen", "greedy, images", greedy(there), best_fit(there))


def budgets(there: Experiment) -> Iterator[Row]:
    """The best predictor on other budgets, and on all of them without mirror images."""
    main, *others = there.reproduce.budgets
    fit = best_fit(there).but(trust=False)
    alone = replace(fit, mirror=())
    yield Row("best-eigen without images", "greedy", greedy(there, main, plain=True), alone)
    for budget in others:
        yield Row("best-eigen without images", "greedy", greedy(there, budget, plain=True), alone)
        yield Row("best-eigen", "greedy, images", greedy(there, budget), fit)


def beside(there: Experiment) -> Iterator[Row]:
    """EDMD on the very same trajectories."""
    for fit in BESIDE:
        size = f"{fit.basis.centres} centres" if isinstance(fit.basis, Splines) else f"order {fit.basis.order}"
        yield Row(f"EDMD, {fit.basis.kind}, {size}", "greedy", greedy(there, plain=True), fit)


def ablation(there: Experiment) -> Iterator[Row]:
    """The best predictor with one ingredient less, named by what is there instead."""
    best, states = best_fit(there).but(trust=False), greedy(there)  # which moves no prediction
    known = round(best.tabulate / there.simulate.dt) - round((best.horizon or HORIZON) / there.simulate.dt)
    shorter = best.but(rounds=0, tabulate=known * there.simulate.dt)
    less: list[tuple[str, SampleChoice, FitEigen]] = [
        ("rates: lattice", states, best.but(eigenvalues="dmd")),
        ("lift: linear", states, best.but(lift="linear")),
        ("lift: moving least squares", states, best.but(lift="mls")),
        ("lift: nearest sample", states, best.but(lift="nearest")),
        ("coordinates: state", states, best.but(coordinates="state")),
        ("distances: plain", states, replace(best, radial_power=1.0)),
        ("neighbours: any", states, best.but(spacing=None)),
        ("no continuation", states, shorter),
        ("no images", greedy(there, plain=True), replace(best, mirror=())),
        ("all starts on Γ", _on_surface(there, states), best),
        ("window: trajectory", states, _along(shorter)),
    ]
    for label, sample, fit in less:
        yield Row(label, "surface" if isinstance(sample, EllipsoidSample) else "greedy", sample, fit)


def _along(fit: FitEigen) -> FitEigen:
    """The fit with the paper's window, which has state coordinates and no estimate of its errors."""
    return fit.but(window="trajectory", boundary="optimal")


def _on_surface(there: Experiment, like: GreedySample) -> EllipsoidSample:
    return replace(surface(there), mesh="fibonacci", count=max(10, like.count), steps=like.steps)


def sweep(there: Experiment) -> Iterator[tuple[int, Row]]:
    """How many rates of which kind, everything else as in the best predictor but for what takes long."""
    best = best_fit(there).but(rounds=0, tabulate=TABLE, trust=False, spacing=None, nodes=THINNED)
    states = greedy(there)
    for fit in recipes.mode_fits(best, there.reproduce.pairs):
        yield fit.eigenvalues.count(STATES), Row(fit.eigenvalues.kind, "greedy, images", states, fit)


def unseen(experiment: Experiment) -> list[tuple[str, Experiment]]:
    """Vehicles that nothing was chosen on."""
    plan = experiment.reproduce
    others = replace(experiment, reproduce=replace(plan, beside=plan.unseen))
    return recipes.vehicles(others)[1:]


def best_fit(there: Experiment) -> FitEigen:
    """The fit of the experiment best-eigen."""
    return recipes.best_eigen(there).fit_eigen


def greedy(there: Experiment, budget: float | None = None, *, plain: bool = False) -> GreedySample:
    """Its design for another vehicle, on the main budget unless told otherwise; ``plain``: without images."""
    found = recipes.best_eigen(there, budget).sample("greedy")
    if not isinstance(found, GreedySample):
        raise InvalidValueError("the experiment best-eigen must have a sample of kind 'greedy'")
    return replace(found, mirror=()) if plain else found


def _cell(block: str, row: Row, there: Experiment, vehicle: str, seed: int) -> tuple[Cell, Task]:
    """A row put to a vehicle and to the test states of a seed; predictions are not lifted afresh at every step."""
    training = recipes.simulation(_simulating(there), recipes.sample(row.states), plant="slips")
    if isinstance(row.fit, FitEigen):
        predictor = recipes.fit_eigen(replace(there, fit_eigen=row.fit), training)
    else:
        predictor = recipes.fit_edmd(replace(there, fit_edmd=row.fit), training)
    test = recipes.test_set(there, predictor.ancestor("simulate").settings, seed=seed)
    once = replace(there, evaluate=replace(there.evaluate, relift=False))
    simulated = row.states.trajectories * training.settings.steps * training.settings.dt
    cell = Cell(block, row.label, row.design, simulated, vehicle, seed)
    return cell, recipes.evaluation(once, predictor, test)


def _simulating(there: Experiment) -> Experiment:
    """The experiment with trajectories as long as their samples say."""
    return replace(there, simulate=replace(there.simulate, steps=None, plant=None))


def _count(kind: str) -> int:
    return Rates.kinds()[kind]().count(STATES)
