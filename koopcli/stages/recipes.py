"""From an experiment to tasks: which stage feeds which."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import get_args

from koopcli.checks import restored
from koopcli.config.experiment import Experiment, load_experiment
from koopcli.config.settings import Baseline, BaselineKind, FitName, Simulate
from koopcli.errors import InvalidValueError
from koopcli.koopman.edmd.fit import FitEdmd
from koopcli.koopman.eigen.fit import FitEigen
from koopcli.records import Meta
from koopcli.simulation.samples.point import PointSample
from koopcli.simulation.samples.sample import SampleChoice
from koopcli.stages.asked import in_force, tested_on
from koopcli.stages.base import Task
from koopcli.stages.fit_edmd import is_product
from koopcli.stages.roles import as_inputs
from koopcli.vehicles.plants import PLANTS

BEST, QUICK = "best-eigen", "quick-eigen"  # with composed lookups, and with one
BESIDE = (FitEdmd.of(basis="states"), FitEdmd.of(order=3), FitEdmd.of(order=5))  # of any trajectories, to compare with


def sample(settings: SampleChoice) -> Task:
    """The sample of ``settings``."""
    return Task("sample", settings.settled())


def simulation(experiment: Experiment, of: Task | None = None, plant: str = "forces") -> Task:
    """Training trajectories, from the experiment's sample for its plant (else ``plant``) or from the one given."""
    usual = type(experiment.simulate.plant or experiment.plant_for(PLANTS[plant]))
    start = of or sample(experiment.sample(usual.training))
    driven = experiment.simulate.plant or experiment.plant_for(start.settings.meant_for)
    return Task("simulate", experiment.simulate.settled(driven, start.settings.horizon), (("sample", start),))


def fit_edmd(experiment: Experiment, *of: Task) -> Task:
    """The EDMD predictor, from the experiment's training set or the trajectories given."""
    trajectories = of or (simulation(experiment, plant="forces"),)
    fit = experiment.fit_edmd if trajectories[0].stage == "simulate" else experiment.measured_fit
    if is_product(fit, trajectories):
        fit = fit.but(chunk=FitEdmd.chunk)  # which has no effect
    return Task("fit-edmd", fit, as_inputs(trajectories))


def fit_eigen(experiment: Experiment, of: Task | None = None) -> Task:
    """The eigenfunction predictor, from the experiment's training set or the trajectories given."""
    trajectories = of or simulation(experiment, plant="slips")
    return Task("fit-eigen", experiment.fit_eigen, (("trajectories", trajectories),))


def baseline(experiment: Experiment, of: Task | None = None) -> Task:
    """A baseline beside the predictors of the experiment's training set or of the trajectories given."""
    trajectories = of or simulation(experiment, plant="slips")
    return Task("baseline", experiment.baseline, (("trajectories", trajectories),))


METHODS: dict[str, Callable[[Experiment], Task]] = {
    "fit-edmd": fit_edmd,
    "fit-eigen": fit_eigen,
    "baseline": baseline,
}


def predictor(experiment: Experiment, usual: FitName = "fit-edmd") -> Task:
    """The predictor that the experiment is about, of the ``usual`` fit where it does not say which."""
    return METHODS[experiment.about.fit or usual](experiment)


def test_set(experiment: Experiment, plant: Simulate, **changed: object) -> Task:
    """Test trajectories of ``plant``, with its vehicle and period, from the experiment's test states for it.

    Predictions that restart are made along the one trajectory that the paper draws, where the plant has one.
    ``changed``: settings of the test sample to replace.
    """
    assert plant.plant is not None, "settled when it was simulated"
    kind = plant.plant.test
    if experiment.evaluate.restart is not None and isinstance(plant.plant, PointSample.meant_for):
        kind = PointSample.kind
    alike = replace(experiment, simulate=replace(experiment.simulate, dt=plant.dt))
    settings = replace(alike.test(kind, plant.vehicle), **changed)  # type: ignore[type-var]
    return Task("simulate", replace(plant.clean(), steps=settings.horizon), (("sample", sample(settings)),))


def driven(experiment: Experiment, plant: Simulate) -> Task:
    """The one trajectory that the paper draws with random inputs, of ``plant`` with its vehicle and period."""
    start = experiment.tabled("point")
    return Task("simulate", replace(plant.clean(), steps=start.horizon), (("sample", sample(start)),))


def remembered_simulation(about: Meta, dt: float) -> Simulate:
    """The simulation that a predictor remembers, for when its trajectories are no longer in the store."""
    simulate = restored(Simulate, {**about, "dt": dt})
    assert simulate.plant is not None, "remembered"
    return simulate.settled(simulate.plant, 1)


def evaluation(experiment: Experiment, of: Task | None = None, on: Task | None = None) -> Task:
    """The evaluation of a predictor, else of the experiment's own, on the trajectories given, else on a test set of
    its plant.
    """
    scored = of or predictor(experiment)
    trajectories = on or test_set(experiment, tested_on(scored, scored.ancestor("simulate").settings))
    first = experiment.evaluate.first
    if first is None:
        first = trajectories.settings.plant.first
    relift = experiment.evaluate.relift
    if relift is None:
        composed = scored.stage == "fit-eigen" and scored.settings.window.lookup_steps is not None
        relift = not (composed or (scored.stage == "fit-edmd" and bool(scored.settings.memory)))
    settings = replace(in_force(experiment.evaluate, scored), first=first, relift=relift)
    return Task("evaluate", settings, (("predictor", scored), ("trajectories", trajectories)))


def with_order(experiment: Experiment, order: int) -> Experiment:
    """The experiment with another basis order. Raises ``InvalidValueError`` for a basis without any."""
    basis = experiment.fit_edmd.basis
    if not hasattr(basis, "order"):
        raise InvalidValueError(f"the basis '{basis.kind}' has no order to sweep: choose polynomials")
    return replace(experiment, fit_edmd=experiment.fit_edmd.but(order=order))


DEGREES = (1, 2, 3)  # of the lattice, where modes are swept


def mode_fits(fit: FitEigen, pairs: Sequence[int]) -> list[FitEigen]:
    """The fit with every number of rates of every kind: the lattice by its degree, the others by their ``pairs``."""
    return [
        *(fit.but(eigenvalues="dmd", degree=degree) for degree in DEGREES),
        *(fit.but(eigenvalues=kind, pairs=count) for kind in ("comb", "varpro") for count in pairs),
    ]


def best_eigen(experiment: Experiment, budget: float | None = None, name: str = BEST) -> Experiment:
    """The experiment with the sample and the fit of best-eigen, or of the experiment ``name``, for its own vehicle and
    period and its main budget.
    """
    main = experiment.reproduce.budgets[0]
    best = _best_eigen(main if budget is None else budget, name)
    simulate = replace(experiment.simulate, plant=None, steps=None)
    return replace(best, simulate=simulate, evaluate=experiment.evaluate)


@cache
def _best_eigen(budget: float, name: str) -> Experiment:
    return load_experiment(name, {"sample": {"greedy": {"budget": budget}}})


def side_by_side(experiment: Experiment) -> list[Task]:
    """Evaluations on one test set: the experiment's predictor, of eigenfunctions where it does not say which, and what
    that is set beside.
    """
    main = predictor(experiment, "fit-eigen")
    others = beside(experiment, main.input("trajectories"))
    test = evaluation(experiment, main).input("trajectories")
    return [evaluation(experiment, task, test) for task in dict.fromkeys((main, *others))]


def vehicles(experiment: Experiment) -> list[tuple[str, Experiment]]:
    """The experiment's own vehicle and those beside it, each under a name of its own; the same one only once."""
    variants = [(experiment.vehicle_name, experiment)]
    for name in experiment.reproduce.beside:
        variant = experiment.with_vehicle(name)
        label = Path(name).stem
        labels = [label for label, _ in variants]
        if label in labels:
            label = f"{label} as its file has it"
        if label in labels:
            label = f"{label} ({len(labels)})"
        if all(variant.vehicle != taken.vehicle for _, taken in variants):
            variants.append((label, variant))
    return variants


def beside(experiment: Experiment, training: Task) -> Iterator[Task]:
    """What any predictor of ``training`` is set beside: baselines without any fit, and EDMD of the same data."""
    for kind in get_args(BaselineKind):
        yield baseline(replace(experiment, baseline=Baseline(kind)), training)
    for fit in BESIDE:
        yield fit_edmd(replace(experiment, fit_edmd=fit), training)
