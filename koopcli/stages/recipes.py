"""From an experiment to tasks: which stage feeds which."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from koopcli.checks import build
from koopcli.config.experiment import Experiment
from koopcli.config.settings import BoxSample, GridSample, ImageFormat, Plot, Series, Simulate
from koopcli.errors import InvalidValueError
from koopcli.figures import source_digest
from koopcli.koopman.predictor import Predictor
from koopcli.stages.base import Task

FITS = ("fit-edmd",)


def sample(settings: GridSample | BoxSample) -> Task:
    """The sample of ``settings``."""
    return Task("sample", settings.settled() if isinstance(settings, BoxSample) else settings)


def simulation(experiment: Experiment, of: Task | None = None) -> Task:
    """Training trajectories, from the experiment's sample or the one given."""
    start = of or sample(experiment.sample)
    steps = experiment.simulate.steps or start.settings.horizon
    return Task("simulate", replace(experiment.simulate, steps=steps), (("sample", start),))


def fit_edmd(experiment: Experiment, of: Task | None = None) -> Task:
    """The EDMD predictor, from the experiment's training set or the trajectories given."""
    return Task("fit-edmd", experiment.fit_edmd, (("trajectories", of or simulation(experiment)),))


def test_set(experiment: Experiment, plant: Simulate) -> Task:
    """Test trajectories of ``plant``, with its vehicle and period, from the experiment's test states."""
    return Task("simulate", replace(plant, steps=experiment.test.steps), (("sample", sample(experiment.test)),))


def remembered_plant(predictor: Predictor) -> Simulate:
    """The plant that a predictor remembers, for when its trajectories are no longer in the store."""
    return build(Simulate, {**predictor.plant, "dt": predictor.dt})


def evaluation(experiment: Experiment, of: Task | None = None, on: Task | None = None) -> Task:
    """The evaluation of a predictor on the trajectories given, or on a test set of its own plant."""
    predictor = of or fit_edmd(experiment)
    trajectories = on or test_set(experiment, predictor.ancestor("simulate").settings)
    return Task("evaluate", experiment.evaluate, (("predictor", predictor), ("trajectories", trajectories)))


def with_order(experiment: Experiment, order: int) -> Experiment:
    """The experiment with another basis order."""
    return replace(experiment, fit_edmd=replace(experiment.fit_edmd, order=order))


def order_sweep(experiment: Experiment) -> list[Task]:
    """One evaluation for each order of the experiment's sweep."""
    return [evaluation(with_order(experiment, order)) for order in experiment.reproduce.orders]


def orders_figure(evaluations: Sequence[Task], image: ImageFormat) -> Task:
    """The figure of errors against order, from evaluations of EDMD predictors.

    Raises ``InvalidValueError`` when two of them would be one point of one curve.
    """
    series = tuple(_series(task) for task in evaluations)
    for one in series:
        if series.count(one) > 1:
            raise InvalidValueError(
                f"several evaluations of order {one.order}, draw {one.draw}, {one.excitation} inputs: name each once, "
                "and those of one experiment"
            )
    settings = Plot("orders", image, series, source_digest())
    return Task("plot", settings, tuple((str(i), task) for i, task in enumerate(evaluations)))


def _series(task: Task) -> Series:
    predictor = task.input("predictor")
    training, test = predictor.ancestor("sample").settings, task.input("trajectories").ancestor("sample").settings
    draw = f"{training.draw} {training.seed}" if isinstance(training, GridSample) else "box"
    excitation = test.excitation if isinstance(test, BoxSample) else "grid"
    return Series(predictor.ancestor("fit-edmd").settings.order, draw, excitation)
