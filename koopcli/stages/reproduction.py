"""The paper's EDMD experiment as a whole: the sweep over draws, orders and test inputs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from koopcli.config.experiment import Experiment
from koopcli.config.settings import BoxSample, GridSample, ImageFormat
from koopcli.errors import InvalidValueError
from koopcli.records import Meta
from koopcli.stages import recipes
from koopcli.stages.base import Task
from koopcli.stages.pipeline import Artefact, Pipeline
from koopcli.store import Record


@dataclass(frozen=True)
class Cell:
    """One predictor on one test set."""

    draw: str
    seed: int
    order: int
    excitation: str


@dataclass(frozen=True)
class Sweep:
    """The figures of every cell, and the records that hold them."""

    experiment: Experiment
    figures: dict[Cell, Meta]
    records: tuple[Record, ...]

    def rmse(self, draw: str, order: int, excitation: str) -> Meta | None:
        """{mean, std, median, max} in percent, if the sweep has the cell."""
        for cell, figures in self.figures.items():
            if (cell.draw, cell.order, cell.excitation) == (draw, order, excitation):
                return dict(figures["rmse"])
        return None

    def yaw_error(self, draw: str, highest: int) -> float | None:
        """Largest yaw-rate error in rad/s up to order ``highest``."""
        errors = [f["max_error"]["yaw_rate"] for c, f in self.figures.items() if c.draw == draw and c.order <= highest]
        return max(errors) if errors else None


def sweep_tasks(experiment: Experiment) -> Iterator[tuple[Cell, Task]]:
    """Every cell of the experiment with its evaluation."""
    plan = experiment.reproduce
    training = _grid(experiment)
    for draw in plan.draws:
        for order in plan.orders:
            for excitation in plan.excitations:
                cell = replace(
                    recipes.with_order(experiment, order),
                    sample=replace(training, draw=draw),
                    test=replace(experiment.test, excitation=excitation),
                )
                yield Cell(draw, training.seed, order, excitation), recipes.evaluation(cell)


def run_sweep(experiment: Experiment, pipeline: Pipeline, label: str) -> Sweep:
    """Make or find every cell, with a progress display called ``label``."""
    figures: dict[Cell, Meta] = {}
    records: list[Record] = []
    cells = list(sweep_tasks(experiment))
    with pipeline.reporter.progress(label) as progress:
        for i, (cell, task) in enumerate(cells):
            progress(i, len(cells))
            artefact = pipeline.make(task)
            figures[cell] = artefact.figures
            records.append(artefact.record)
    return Sweep(experiment, figures, tuple(records))


def sweep_figure(experiment: Experiment, pipeline: Pipeline, image: ImageFormat = "png") -> Artefact:
    """Errors against order on the first draw, with the test inputs the paper states if the sweep has them."""
    plan = experiment.reproduce
    excitation = "fresh" if "fresh" in plan.excitations else plan.excitations[0]
    chosen = [t for c, t in sweep_tasks(experiment) if (c.draw, c.excitation) == (plan.draws[0], excitation)]
    return pipeline.make(recipes.orders_figure(chosen, image))


def _grid(experiment: Experiment) -> GridSample:
    if isinstance(experiment.sample, BoxSample):
        raise InvalidValueError("reproduce edmd trains on a grid: sample.kind must be 'grid'")
    return experiment.sample
