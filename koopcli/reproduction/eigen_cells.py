"""What the eigenfunction experiment consists of: its reading, the readings beside it, sensitivities and baselines."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product

from koopcli.choices import written
from koopcli.config.experiment import Experiment
from koopcli.errors import InvalidValueError
from koopcli.koopman.eigen.fit import FitEigen
from koopcli.simulation.samples.ball import BallSample
from koopcli.simulation.samples.ellipsoid import EllipsoidSample
from koopcli.stages import recipes
from koopcli.stages.base import Task
from koopcli.stages.fits import outlook
from koopcli.vehicles.handling import G

CUT = 1e-10  # of the readings with optimal boundary functions
PEAK = 7800.0  # N, a peak force that does not follow the load
LITERAL_STEPS, LITERAL_TABLE = 1.0, 0.5  # s: "T = 1 s" taken as all that is simulated
CENTRES = (382, 441, 1000)  # distinct initial states, all of them, and many
FEW_CENTRES = 100
HEADLINE, READINGS, CUTS, GRIP, BASELINES = "headline", "readings", "cuts", "grip", "baselines"


@dataclass(frozen=True)
class EigenCell:
    """One reading of the method, or a baseline, on the test states of one seed. ``block`` is the table it stands in."""

    block: str
    label: str
    vehicle: str
    seed: int


def cells(experiment: Experiment) -> Iterator[tuple[EigenCell, Task]]:
    """Every cell of the experiment with its evaluation."""
    plan, everywhere = experiment.reproduce, recipes.vehicles(experiment)
    first = plan.seeds[0]
    for (vehicle, own), seed in product(everywhere, plan.seeds):
        yield EigenCell(HEADLINE, "as the experiment says", vehicle, seed), headline(own, seed)
    yield from _readings(experiment)
    for fit, cut in product((splines(experiment), optimal(experiment, None)), plan.cuts):
        label = f"{written(fit)['boundary']}, cut {cut:g}"
        task = evaluated(experiment, fit.but(cut=cut), first)
        yield EigenCell(CUTS, label, experiment.vehicle_name, first), task
    for vehicle, own in everywhere:
        for scale in plan.mu_scales:
            label, gripping = f"grip × {scale:g}", own.with_parameters(mu_scale=scale * own.vehicle.mu_scale)
            yield EigenCell(GRIP, label, vehicle, first), headline(gripping, first)
            task = evaluated(gripping, optimal(experiment, CUT), first)
            yield EigenCell(GRIP, f"{label}, optimal{cut_text(CUT)}", vehicle, first), task
        for task in beside(own, first):
            yield EigenCell(BASELINES, outlook(task.input("predictor")).name, vehicle, first), task


def _readings(experiment: Experiment) -> Iterator[tuple[EigenCell, Task]]:
    """Other readings of the paper's text."""
    seeds, main = experiment.reproduce.seeds, experiment.vehicle_name

    def row(label: str, fit: FitEigen, of: Experiment = experiment) -> tuple[EigenCell, Task]:
        return EigenCell(READINGS, label, main, seeds[0]), evaluated(of, fit, seeds[0])

    plain = splines(experiment)
    for centres in CENTRES:
        yield row(f"thin-plate, {centres} centres, scaled", plain.but(centres=centres, scaling="extent"))
    for cut in (None, CUT):
        label = f"thin-plate, {FEW_CENTRES} centres{cut_text(cut)}"
        yield row(label, plain.but(centres=FEW_CENTRES, **({} if cut is None else {"cut": cut})))
    for cut in (None, CUT):
        label, fit = f"optimal{cut_text(cut)}", optimal(experiment, cut)
        for (vehicle, own), seed in product(recipes.vehicles(experiment), seeds):
            yield EigenCell(READINGS, label, vehicle, seed), evaluated(own, fit, seed)
        for degree in (1, 3):
            yield row(f"{label}, sums of up to {degree}", fit.but(degree=degree))
        literal = f"{label}, {LITERAL_STEPS:g} s simulated, {LITERAL_TABLE:g} s tabulated"
        yield row(literal, fit.but(tabulate=LITERAL_TABLE), _simulating(experiment, LITERAL_STEPS))
    yield row(f"optimal{cut_text(CUT)}, D = {PEAK:g} N", optimal(experiment, CUT), _with_peak(experiment))


def splines(experiment: Experiment) -> FitEigen:
    """The paper's reading: a row means what it says, whatever the experiment changes."""
    return FitEigen.of(tabulate=experiment.fit_eigen.tabulate)


def optimal(experiment: Experiment, cut: float | None) -> FitEigen:
    """The best boundary values there are."""
    return splines(experiment).but(boundary="optimal", cut=cut)


def headline(experiment: Experiment, seed: int) -> Task:
    """The evaluation of the experiment's own reading on the test states of a seed."""
    return evaluated(experiment, experiment.fit_eigen, seed)


def evaluated(experiment: Experiment, fit: FitEigen, seed: int) -> Task:
    """The evaluation of one fit on the test states of a seed."""
    predictor = recipes.fit_eigen(replace(experiment, fit_eigen=fit), _training(experiment))
    return scored(experiment, predictor, seed)


def beside(experiment: Experiment, seed: int) -> list[Task]:
    """Evaluations of what the experiment's own reading is set beside, the first state held first."""
    return [scored(experiment, predictor, seed) for predictor in recipes.beside(experiment, _training(experiment))]


def scored(experiment: Experiment, predictor: Task, seed: int) -> Task:
    """The evaluation of a predictor on the test states of a seed."""
    test = recipes.test_set(experiment, predictor.ancestor("simulate").settings, seed=seed)
    return recipes.evaluation(experiment, predictor, test)


def _training(experiment: Experiment) -> Task:
    surface(experiment)
    return recipes.simulation(experiment, plant="slips")


def _simulating(experiment: Experiment, seconds: float) -> Experiment:
    """The experiment with trajectories of so many seconds."""
    simulate = experiment.simulate
    return replace(experiment, simulate=replace(simulate, steps=max(1, round(seconds / simulate.dt))))


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
    sample = experiment.sample("ellipsoid")
    if not isinstance(sample, EllipsoidSample):
        raise InvalidValueError("reproduce eigen starts from an ellipsoid: sample.kind must be 'ellipsoid'")
    return sample


def ball(experiment: Experiment) -> BallSample:
    """The test states. Raises ``InvalidValueError`` for another kind."""
    sample = experiment.test("ball", experiment.vehicle)
    if not isinstance(sample, BallSample):
        raise InvalidValueError("reproduce eigen tests on states in a ball: test.kind must be 'ball'")
    return sample
