"""What goes beyond the paper: its surface with better rates and lifts, other designs of Γ, and one ingredient less."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import product
from typing import Literal

from koopcli.choices import written
from koopcli.config.experiment import Experiment
from koopcli.errors import InvalidValueError
from koopcli.koopman.edmd.fit import FitEdmd
from koopcli.koopman.eigen.fit import FitEigen
from koopcli.reproduction.eigen_cells import CUT, optimal, surface
from koopcli.simulation.samples.ellipsoid import EllipsoidSample
from koopcli.simulation.samples.greedy import GreedySample
from koopcli.simulation.samples.sample import SampleChoice
from koopcli.stages import recipes
from koopcli.stages.base import Task

SHELLS, SHELL_STEPS, SHELL_TABLE = 6, 80, 0.3  # of the design by shells; s
TABLE, HORIZON = 0.5, 0.5  # s, of trajectories of one second
THINNED = 20  # nodes of each trajectory, where neighbours are not chosen apart
LADDER, BUDGETS, EDMD, ABLATION, UNSEEN, MODES = "ladder", "budgets", "edmd", "ablation", "unseen", "modes"
NOISE, MEMORY = "noise", 0.8  # and how much of coloured noise stays from sample to sample
BEST_LABEL = "and composed lookups: best-eigen"
BESIDE = {
    "EDMD, total, order 7": FitEdmd.of(basis="total", order=7),
    "EDMD, thin-plate, 300 centres": FitEdmd.of(basis="thin-plate", centres=300),
    "EDMD, total, order 9": FitEdmd.of(basis="total", order=9),
}  # of the same trajectories
PAIRS, HIGHEST, FINER = 14, 40.0, 1e-12  # of a comb of 90 functions: its pairs, rad/s, and the cut
STATES = 3  # of the plant on tyres


@dataclass(frozen=True)
class BeyondCell:
    """One predictor on the test states of one seed. ``block`` is the table it stands in, ``design`` its initial states
    and ``simulated`` the seconds of its trajectories; ``modes``: how many rates it has, where they are swept;
    ``noise``: that of its trajectories, in words.
    """

    block: str
    label: str
    design: str
    simulated: float
    vehicle: str
    seed: int
    modes: int = 0
    noise: str = ""


@dataclass(frozen=True)
class Row:
    """A predictor before it is put to a vehicle and to test states: initial ``states``, and its ``fit``; the ``noise``
    of its trajectories in m/s, and its ``memory``.
    """

    label: str
    design: str
    states: SampleChoice
    fit: FitEigen | FitEdmd
    modes: int = 0
    noise: float = 0.0
    memory: float = 0.0


AHEAD = FitEigen.of(window="horizon", eigenvalues="comb", cut=CUT, tabulate=TABLE, horizon=HORIZON)


def cells(experiment: Experiment) -> Iterator[tuple[BeyondCell, Task]]:
    """Every cell with its evaluation."""
    seeds, everywhere = experiment.reproduce.seeds[:2], recipes.vehicles(experiment)
    for (vehicle, own), seed in product(everywhere, seeds):
        rows = {LADDER: ladder(own), BUDGETS: budgets(own), EDMD: beside(own), NOISE: noisy(own)}
        yield from _cells(rows, vehicle, own, seed)
    for vehicle, own in everywhere:
        yield from _cells({ABLATION: ablation(own), MODES: sweep(own)}, vehicle, own, seeds[0])
    for (vehicle, own), seed in product(unseen(experiment), seeds):
        yield from _cells({UNSEEN: [quick_row(own), best_row(own)]}, vehicle, own, seed)


def _cells(
    blocks: Mapping[str, Iterable[Row]], vehicle: str, own: Experiment, seed: int
) -> Iterator[tuple[BeyondCell, Task]]:
    """The rows of blocks put to a vehicle and to the test states of a seed."""
    for block, rows in blocks.items():
        for row in rows:
            task = evaluated(row, own, seed)
            simulation = task.input("predictor").ancestor("simulate").settings
            simulated = row.states.trajectories * simulation.steps * simulation.dt
            noise = f"{row.noise:g}{', coloured' if row.memory else ''}" if row.noise else ""
            yield BeyondCell(block, row.label, row.design, simulated, vehicle, seed, row.modes, noise), task


def evaluated(row: Row, experiment: Experiment, seed: int) -> Task:
    """The evaluation of a row on the test states of a seed, where predictions are not lifted afresh at every step, and
    trajectories are as long as their samples say.
    """
    simulate = replace(experiment.simulate, steps=None, plant=None)
    if row.noise:
        simulate = replace(simulate, noise=row.noise, noise_memory=row.memory)
    own = replace(
        experiment,
        simulate=simulate,
        evaluate=replace(experiment.evaluate, relift=False),
    )
    training = recipes.simulation(own, recipes.sample(row.states), plant="slips")
    if isinstance(row.fit, FitEigen):
        predictor = recipes.fit_eigen(replace(own, fit_eigen=row.fit), training)
    else:
        predictor = recipes.fit_edmd(replace(own, fit_edmd=row.fit), training)
    test = recipes.test_set(experiment, predictor.ancestor("simulate").settings, seed=seed)
    return recipes.evaluation(own, predictor, test)


def best(experiment: Experiment, seed: int) -> Task:
    """The evaluation of best-eigen on the test states of a seed."""
    return evaluated(best_row(experiment), experiment, seed)


def quick(experiment: Experiment, seed: int) -> Task:
    """The evaluation of quick-eigen on the test states of a seed."""
    return evaluated(quick_row(experiment), experiment, seed)


def ladder(experiment: Experiment) -> Iterator[Row]:
    """From the paper's reading to the best predictor, an ingredient at a time."""
    gamma, paper = surface(experiment), optimal(experiment, CUT)
    comb, varpro = paper.but(eigenvalues="comb"), paper.but(eigenvalues="varpro")
    yield first_row(experiment)
    yield Row("lattice of rates, linear", "surface", gamma, paper.but(lift="linear"))
    yield Row("comb of rates, nearest sample", "surface", gamma, comb)
    yield Row(f"{varpro.eigenvalues.count(STATES)} best rates, nearest sample", "surface", gamma, varpro)
    yield Row("comb of rates, linear", "surface", gamma, comb.but(lift="linear"))
    yield shells_row(experiment)
    yield shells_row(experiment, "mesh", "sphere")
    filled, linear = greedy(experiment, plain=True), AHEAD.but(lift="linear")
    splines = AHEAD.but(lift="polyharmonic", nodes=THINNED)
    yield Row("comb, linear", "greedy", filled, linear)
    yield Row("comb, splines", "greedy", filled, splines)
    yield Row("comb, linear, world", "greedy", filled, linear.but(coordinates="world"))
    world = splines.but(coordinates="world")
    yield Row("comb, splines, world", "greedy", filled, world)
    mirrored, fit = greedy(experiment), quick_fit(experiment)
    world = world.but(mirror=mirrored.mirror)
    yield Row("the same with images", "greedy, images", mirrored, world)
    spread = world.but(radial_power=fit.radial_power, spacing=fit.lift.spacing, nodes=None)
    yield Row("and distances, neighbours", "greedy, images", mirrored, spread)
    yield quick_row(experiment)
    yield best_row(experiment)


def first_row(experiment: Experiment) -> Row:
    """The first rung of the ladder: the paper's surface, lattice and nearest sample."""
    return Row("lattice of rates, nearest sample", "surface", surface(experiment), optimal(experiment, CUT))


def shells_row(
    experiment: Experiment, spread: str = "spiral", mesh: Literal["sphere", "fibonacci"] = "fibonacci"
) -> Row:
    """The rung of several surfaces, over which states are ``spread`` by a mesh."""
    states = replace(surface(experiment), shells=SHELLS, steps=SHELL_STEPS, mesh=mesh)
    return Row("comb, linear", f"{SHELLS} shells, {spread}", states, AHEAD.but(tabulate=SHELL_TABLE, lift="linear"))


def quick_row(experiment: Experiment) -> Row:
    """The last rung of the ladder with one lookup."""
    return Row("and continuation: quick-eigen", "greedy, images", greedy(experiment), quick_fit(experiment))


def best_row(experiment: Experiment) -> Row:
    """The last rung of the ladder."""
    return Row(BEST_LABEL, "greedy, images", greedy(experiment), best_fit(experiment))


def budgets(experiment: Experiment) -> Iterator[Row]:
    """The best predictors on other budgets, and on all of them without mirror images; with more rates."""
    main, *others = experiment.reproduce.budgets
    for name, shipped in ((recipes.QUICK, quick_fit(experiment)), (recipes.BEST, best_fit(experiment))):
        fit = shipped.but(trust=False)
        alone = fit.but(mirror=())
        yield Row(f"{name} without images", "greedy", greedy(experiment, main, plain=True), alone)
        for budget in others:
            yield Row(f"{name} without images", "greedy", greedy(experiment, budget, plain=True), alone)
            yield Row(name, "greedy, images", greedy(experiment, budget), fit)
    for budget in dict.fromkeys((main, max(others, default=main))):
        yield Row(f"{recipes.BEST}, more rates", "greedy, images", greedy(experiment, budget), more_rates(experiment))


def noisy(experiment: Experiment) -> Iterator[Row]:
    """Predictors of trajectories with noise, as it comes and smoothed; of the largest also coloured, and looked up
    among more neighbours.
    """
    states, shipped = greedy(experiment), {recipes.QUICK: quick_fit(experiment), recipes.BEST: best_fit(experiment)}
    largest = max(experiment.reproduce.noises)
    cases = [(noise, 0.0) for noise in experiment.reproduce.noises]
    for (noise, memory), (name, fit) in product([*cases, (largest, MEMORY)], shipped.items()):
        raw = fit.but(smooth=False, trust=False)
        yield Row(f"{name} --no-smooth", "greedy, images", states, raw, noise=noise, memory=memory)
        yield Row(name, "greedy, images", states, fit, noise=noise, memory=memory)
    wide = shipped[recipes.BEST].but(neighbours=2 * shipped[recipes.BEST].lift.neighbours, trust=False)
    yield Row(f"{recipes.BEST}, {wide.lift.neighbours} neighbours", "greedy, images", states, wide, noise=largest)


def beside(experiment: Experiment) -> Iterator[Row]:
    """EDMD on the very same trajectories."""
    for label, fit in BESIDE.items():
        yield Row(label, "greedy", greedy(experiment, plain=True), fit)


def ablation(experiment: Experiment) -> Iterator[Row]:
    """The best predictor with one ingredient less, named by what is there instead."""
    best, states = best_fit(experiment).but(trust=False), greedy(experiment)  # which moves no prediction
    samples = round(best.tabulate / experiment.simulate.dt) - round(
        (written(best)["horizon"] or HORIZON) / experiment.simulate.dt
    )
    at_once = best.but(lookup_steps=None, tabulate=samples * experiment.simulate.dt)
    less: list[tuple[str, SampleChoice, FitEigen]] = [
        ("rates: lattice", states, best.but(eigenvalues="dmd")),
        ("lift: linear", states, best.but(lift="linear")),
        ("lift: moving least squares", states, best.but(lift="mls")),
        ("lift: nearest sample", states, best.but(lift="nearest")),
        ("coordinates: state", states, best.but(coordinates="state")),
        ("distances: plain", states, best.but(radial_power=1.0, scale=())),
        ("neighbours: any", states, best.but(spacing=None)),
        ("one lookup", states, at_once),
        ("no images", greedy(experiment, plain=True), best.but(mirror=())),
        ("all starts on Γ", _on_surface(experiment, states), best),
        ("window: trajectory", states, _along(at_once)),
    ]
    for label, sample, fit in less:
        yield Row(label, "surface" if isinstance(sample, EllipsoidSample) else "greedy", sample, fit)


def _along(fit: FitEigen) -> FitEigen:
    """The fit with the paper's window, which has state coordinates and no estimate of its errors."""
    return fit.but(window="trajectory", boundary="optimal")


def _on_surface(experiment: Experiment, like: GreedySample) -> EllipsoidSample:
    return replace(surface(experiment), mesh="fibonacci", count=max(10, like.count), steps=like.steps)


def sweep(experiment: Experiment) -> Iterator[Row]:
    """How many rates of which kind, everything else as in quick-eigen but for what takes long."""
    best = quick_fit(experiment).but(rounds=0, tabulate=TABLE, trust=False, spacing=None, nodes=THINNED)
    for fit in recipes.mode_fits(best, experiment.reproduce.pairs):
        modes = fit.eigenvalues.count(STATES)
        yield Row(fit.eigenvalues.kind, "greedy, images", greedy(experiment), fit, modes)


def unseen(experiment: Experiment) -> list[tuple[str, Experiment]]:
    """Vehicles that nothing was chosen on."""
    plan = experiment.reproduce
    others = replace(experiment, reproduce=replace(plan, beside=plan.unseen))
    return recipes.vehicles(others)[1:]


def best_fit(experiment: Experiment) -> FitEigen:
    """The fit of the experiment best-eigen."""
    return recipes.best_eigen(experiment).fit_eigen


def quick_fit(experiment: Experiment) -> FitEigen:
    """The fit of the experiment quick-eigen."""
    return recipes.best_eigen(experiment, name=recipes.QUICK).fit_eigen


def more_rates(experiment: Experiment) -> FitEigen:
    """The fit of best-eigen with a finer and wider comb."""
    return best_fit(experiment).but(pairs=PAIRS, highest=HIGHEST, cut=FINER, trust=False)


def greedy(experiment: Experiment, budget: float | None = None, *, plain: bool = False) -> GreedySample:
    """Its design for another vehicle, on the main budget unless told otherwise; ``plain``: without images."""
    sample = recipes.best_eigen(experiment, budget).sample("greedy")
    if not isinstance(sample, GreedySample):
        raise InvalidValueError("the experiment best-eigen must have a sample of kind 'greedy'")
    return replace(sample, mirror=()) if plain else sample
