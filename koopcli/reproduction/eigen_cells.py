"""What the eigenfunction experiment consists of: its reading, the readings beside it, sensitivities and baselines."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product

from koopcli.checks import written
from koopcli.config.experiment import Experiment
from koopcli.errors import InvalidValueError
from koopcli.koopman.eigen.fit import FitEigen
from koopcli.simulation.samples.ball import BallSample
from koopcli.simulation.samples.ellipsoid import EllipsoidSample
from koopcli.stages import recipes
from koopcli.stages.base import Task
from koopcli.stages.makers import outlook
from koopcli.vehicles.handling import G

CUT = 1e-10  # of the readings with optimal boundary functions
PEAK = 7800.0  # N, a peak force that does not follow the load
LITERAL_STEPS, LITERAL_TABLE = 1.0, 0.5  # s: "T = 1 s" taken as all that is simulated
CENTRES = (382, 441, 1000)  # distinct initial states, all of them, and many
FEW_CENTRES = 100
HEADLINE, READINGS, CUTS, GRIP, BASELINES = "headline", "readings", "cuts", "grip", "baselines"


@dataclass(frozen=True)
class Cell:
    """One reading of the method, or a baseline, on the test states of one seed. ``block`` is the table it stands in."""

    block: str
    label: str
    vehicle: str
    seed: int


def cells(experiment: Experiment) -> Iterator[tuple[Cell, Task]]:
    """Every cell of the experiment with its evaluation."""
    plan, main = experiment.reproduce, experiment.vehicle_name
    first = plan.seeds[0]
    everywhere = recipes.vehicles(experiment)
    as_given = experiment.fit_eigen
    splines = FitEigen.of(tabulate=as_given.tabulate)  # a row means what it says, whatever the experiment changes
    optimal = splines.but(boundary="optimal")

    for (vehicle, there), seed in product(everywhere, plan.seeds):
        yield Cell(HEADLINE, "as the experiment says", vehicle, seed), evaluated(there, as_given, seed)
    for centres in CENTRES:
        fit = splines.but(centres=centres, scaling="extent")
        yield Cell(READINGS, f"thin-plate, {centres} centres, scaled", main, first), evaluated(experiment, fit, first)
    for cut in (None, CUT):
        fit = splines.but(centres=FEW_CENTRES, **({} if cut is None else {"cut": cut}))
        yield (
            Cell(READINGS, f"thin-plate, {FEW_CENTRES} centres{cut_text(cut)}", main, first),
            evaluated(experiment, fit, first),
        )
    for cut in (None, CUT):
        fit = optimal.but(cut=cut)
        for (vehicle, there), seed in product(everywhere, plan.seeds):
            yield Cell(READINGS, f"optimal{cut_text(cut)}", vehicle, seed), evaluated(there, fit, seed)
        for degree in (1, 3):
            label = f"optimal{cut_text(cut)}, sums of up to {degree}"
            yield Cell(READINGS, label, main, first), evaluated(experiment, fit.but(degree=degree), first)
        literal = replace(fit, tabulate=LITERAL_TABLE)
        label = f"optimal{cut_text(cut)}, {LITERAL_STEPS:g} s simulated, {LITERAL_TABLE:g} s tabulated"
        yield Cell(READINGS, label, main, first), evaluated(experiment, literal, first, seconds=LITERAL_STEPS)
    peaked = _with_peak(experiment)
    label = f"optimal{cut_text(CUT)}, D = {PEAK:g} N"
    yield Cell(READINGS, label, main, first), evaluated(peaked, optimal.but(cut=CUT), first)
    for fit, cut in product((splines, optimal), plan.cuts):
        label = f"{written(fit)['boundary']}, cut {cut:g}"
        yield Cell(CUTS, label, main, first), evaluated(experiment, fit.but(cut=cut), first)
    for vehicle, there in everywhere:
        for scale in plan.mu_scales:
            gripping = there.with_parameters(mu_scale=scale * there.vehicle.mu_scale)
            yield Cell(GRIP, f"grip × {scale:g}", vehicle, first), evaluated(gripping, as_given, first)
            label, fit = f"grip × {scale:g}, optimal{cut_text(CUT)}", optimal.but(cut=CUT)
            yield Cell(GRIP, label, vehicle, first), evaluated(gripping, fit, first)
        for predictor in recipes.beside(there, _training(there)):
            yield Cell(BASELINES, outlook(predictor).name, vehicle, first), _scored(there, predictor, first)


def evaluated(experiment: Experiment, fit: FitEigen, seed: int, seconds: float | None = None) -> Task:
    """The evaluation of one fit on the test states of a seed, its trajectories as long as the experiment says."""
    simulate = experiment.simulate
    if seconds is not None:
        simulate = replace(simulate, steps=max(1, round(seconds / simulate.dt)))
    there = replace(experiment, fit_eigen=fit, simulate=simulate)
    return _scored(there, recipes.fit_eigen(there, _training(there)), seed)


def side_by_side(experiment: Experiment, seed: int) -> list[Task]:
    """Evaluations on the test states of a seed: the experiment's own reading, and what it is set beside."""
    predictors = recipes.beside(experiment, _training(experiment))
    return [
        evaluated(experiment, experiment.fit_eigen, seed),
        *(_scored(experiment, predictor, seed) for predictor in predictors),
    ]


def _training(experiment: Experiment) -> Task:
    surface(experiment)
    return recipes.simulation(experiment, plant="slips")


def _scored(experiment: Experiment, predictor: Task, seed: int) -> Task:
    test = recipes.test_set(experiment, predictor.ancestor("simulate").settings, seed=seed)
    return recipes.evaluation(experiment, predictor, test)


def _with_peak(experiment: Experiment) -> Experiment:
    """The experiment with tyres whose lateral peak is ``PEAK`` N under the mean wheel load, whatever the grip."""
    vehicle = experiment.vehicle
    tyre, load = vehicle.lateral, vehicle.m * G / 4
    return experiment.with_parameters(lateral=replace(tyre, mu=PEAK / load) if tyre else None, mu_scale=1.0)


def cut_text(cut: float | None) -> str:
    """The cut as the end of a label."""
    return "" if cut is None else f", cut {cut:g}"


def surface(experiment: Experiment) -> EllipsoidSample:
    """Γ. Raises ``InvalidValueError`` for another kind."""
    found = experiment.sample("ellipsoid")
    if not isinstance(found, EllipsoidSample):
        raise InvalidValueError("reproduce eigen starts from an ellipsoid: sample.kind must be 'ellipsoid'")
    return found


def ball(experiment: Experiment) -> BallSample:
    """The test states. Raises ``InvalidValueError`` for another kind."""
    found = experiment.test("ball", experiment.vehicle)
    if not isinstance(found, BallSample):
        raise InvalidValueError("reproduce eigen tests on states in a ball: test.kind must be 'ball'")
    return found
