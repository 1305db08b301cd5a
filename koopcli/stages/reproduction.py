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
class Scored:
    """A cell with the figures of its evaluation and the record that holds them."""

    cell: Cell
    figures: Meta
    record: Record


@dataclass(frozen=True)
class Sweep:
    """Every cell of an experiment, scored."""

    experiment: Experiment
    scored: tuple[Scored, ...]

    def figures(self, draw: str, order: int, excitation: str) -> Meta | None:
        """The figures of a cell, if the sweep has it."""
        wanted = (draw, order, excitation)
        return next((s.figures for s in self.scored if (s.cell.draw, s.cell.order, s.cell.excitation) == wanted), None)

    def yaw_error(self, draw: str, highest: int) -> float | None:
        """Largest yaw-rate error in rad/s up to order ``highest``."""
        chosen = (s for s in self.scored if s.cell.draw == draw and s.cell.order <= highest)
        return max((s.figures["max_error"]["yaw_rate"] for s in chosen), default=None)


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
    scored = []
    cells = list(sweep_tasks(experiment))
    with pipeline.reporter.progress(label) as progress:
        for i, (cell, task) in enumerate(cells):
            progress(i, len(cells))
            artefact = pipeline.make(task)
            scored.append(Scored(cell, artefact.figures, artefact.record))
    return Sweep(experiment, tuple(scored))


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
