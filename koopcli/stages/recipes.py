"""From an experiment to tasks: which stage feeds which."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from koopcli.checks import build
from koopcli.config.experiment import Experiment
from koopcli.config.settings import (
    CUSTOMS,
    INPUTS,
    SAMPLED_FOR,
    BoxSample,
    ImageFormat,
    Plot,
    SampleSettings,
    Series,
    Simulate,
)
from koopcli.errors import InvalidValueError
from koopcli.figures import source_digest
from koopcli.figures.registry import FIGURES
from koopcli.records import Meta
from koopcli.stages.base import Task
from koopcli.stages.makers import MAKERS, prospect

FITS = tuple(MAKERS)


def sample(settings: SampleSettings) -> Task:
    """The sample of ``settings``."""
    return Task("sample", settings.settled())


def simulation(experiment: Experiment, of: Task | None = None, plant: str = "forces") -> Task:
    """Training trajectories, from the experiment's sample for its plant (else ``plant``) or from the one given."""
    given = experiment.simulate.plant
    start = of or sample(experiment.sample(CUSTOMS[given or plant].training))
    settings = replace(
        experiment.simulate,
        plant=given or SAMPLED_FOR[start.settings.kind],
        steps=experiment.simulate.steps or start.settings.horizon,
    )
    return Task("simulate", settings.settled(), (("sample", start),))


def fit_edmd(experiment: Experiment, of: Task | None = None) -> Task:
    """The EDMD predictor, from the experiment's training set or the trajectories given."""
    trajectories = of or simulation(experiment, plant="forces")
    return Task("fit-edmd", experiment.fit_edmd.settled(), (("trajectories", trajectories),))


def fit_eigen(experiment: Experiment, of: Task | None = None) -> Task:
    """The eigenfunction predictor, from the experiment's training set or the trajectories given."""
    trajectories = of or simulation(experiment, plant="slips")
    return Task("fit-eigen", experiment.fit_eigen.settled(), (("trajectories", trajectories),))


def baseline(experiment: Experiment, of: Task | None = None) -> Task:
    """A baseline beside the predictors of the experiment's training set or of the trajectories given."""
    trajectories = of or simulation(experiment, plant="slips")
    return Task("baseline", experiment.baseline, (("trajectories", trajectories),))


def test_set(experiment: Experiment, plant: Simulate, **changed: object) -> Task:
    """Test trajectories of ``plant``, with its vehicle and period, from the experiment's test states for it.

    ``changed``: settings of the test sample to replace.
    """
    assert plant.plant is not None, "settled when it was simulated"
    settings = replace(experiment.test(CUSTOMS[plant.plant].test, plant.vehicle), **changed)  # type: ignore[arg-type]
    return Task("simulate", replace(plant, steps=settings.horizon), (("sample", sample(settings)),))


def remembered_simulation(about: Meta, dt: float) -> Simulate:
    """The simulation that a predictor remembers, for when its trajectories are no longer in the store."""
    return build(Simulate, {**about, "dt": dt})


def evaluation(experiment: Experiment, of: Task | None = None, on: Task | None = None) -> Task:
    """The evaluation of a predictor on the trajectories given, or on a test set of its own plant."""
    predictor = of or fit_edmd(experiment)
    trajectories = on or test_set(experiment, predictor.ancestor("simulate").settings)
    first = experiment.evaluate.first
    if first is None:
        first = CUSTOMS[trajectories.settings.plant].first
    settings = replace(experiment.evaluate, first=first)
    return Task("evaluate", settings, (("predictor", predictor), ("trajectories", trajectories)))


def with_order(experiment: Experiment, order: int) -> Experiment:
    """The experiment with another basis order."""
    return replace(experiment, fit_edmd=replace(experiment.fit_edmd, order=order))


def order_sweep(experiment: Experiment) -> list[Task]:
    """One evaluation for each order of the experiment's sweep."""
    return [evaluation(with_order(experiment, order)) for order in experiment.reproduce.orders]


def drawn_by_default(figure: str, experiment: Experiment) -> list[Task]:
    """The evaluations that a figure draws when none is named."""
    if FIGURES[figure].several:
        return order_sweep(experiment)
    return [evaluation(experiment, fit_eigen(experiment))]


def figure(name: str, evaluations: Sequence[Task], image: ImageFormat) -> Task:
    """The figure ``name`` of ``evaluations``.

    Raises ``InvalidValueError`` for more of them than it draws, and for two that would be one point of one curve.
    """
    kind = FIGURES[name]
    if len(evaluations) != 1 and not kind.several:
        raise InvalidValueError(f"the figure '{name}' draws one evaluation, got {len(evaluations)}")
    series = tuple(_series(task) for task in evaluations)
    for one in series:
        if kind.several and one.order is None:
            raise InvalidValueError(
                f"the figure '{name}' takes evaluations of EDMD predictors, which have an order, not of {one.label}"
            )
        if series.count(one) > 1:
            raise InvalidValueError(
                f"several evaluations of order {one.order}, {one.label}: name each once, and those of one experiment"
            )
    inputs = tuple((f"{i}/{role}", _behind(task, role)) for i, task in enumerate(evaluations) for role in kind.roles)
    return Task("plot", build(Plot, vars(Plot(name, image, series, source_digest()))), inputs)  # type: ignore[arg-type]


def _behind(evaluation: Task, role: str) -> Task:
    """The evaluation itself, or what it was made from."""
    if role == "evaluation":
        return evaluation
    if role == "training":
        return evaluation.input("predictor").input("trajectories")
    return evaluation.input(role)


def _series(evaluation: Task) -> Series:
    about, test = prospect(evaluation.input("predictor")), evaluation.input("trajectories").ancestor("sample").settings
    inputs = INPUTS[test.excitation] if isinstance(test, BoxSample) else test.kind
    return Series(f"{about.label}, {inputs}", about.order)
