"""What a reproduction consists of: a method's cells, their scores, and the tables made of them.

A method yields cells, each with the task of its evaluation (``cells``). A run makes the tasks and keeps their scores.
Tables lay out a block of cells by the cells' own fields (``layout.py``). Notes, claims, headlines and pictures build
the task that they speak of and look its score up (``Run.figures``).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from koopcli.config.experiment import Experiment
from koopcli.config.pictures import ImageFormat
from koopcli.records import Meta
from koopcli.stages import figure_tasks
from koopcli.stages.base import Task
from koopcli.stages.pipeline import Pipeline
from koopcli.store import Record

REDUCED = "This run is not of the paper's size: its numbers cannot be put beside the paper's."
RASTERS: frozenset[str] = frozenset({"error-map", "error-side", "energy-surface", "density", "spectrum"})
# figures of thousands of marks, which are smaller as PNG at the paper's size; all others are smaller as SVG


@dataclass(frozen=True)
class Table:
    """A table of texts: numbers that stand in columns, the first ``left`` of which are names, or ``words`` of
    several lines that are read across.
    """

    title: str
    header: list[str]
    rows: list[list[str]]
    words: bool = False
    left: int = 1


@dataclass(frozen=True)
class Scored:
    """A cell of a method and its ``task``, with the numbers of that evaluation and the record that holds them."""

    cell: Any
    task: Task
    figures: Meta
    record: Record
    measured: Mapping[str, float] = field(default_factory=dict)
    """What the method measured of it in this run, which is in no artefact."""


@dataclass(frozen=True)
class Run:
    """Every cell of an experiment, scored. ``label`` tells runs apart: "here", or what was changed.

    ``base``: what the experiment was called on the command line, ``changes``: what ``--set`` changed of it.
    """

    label: str
    experiment: Experiment
    scored: tuple[Scored, ...]
    base: str = "paper"
    changes: tuple[str, ...] = ()

    def figures(self, task: Task) -> Meta:
        """The numbers of an evaluation of a whole run."""
        return self._figures[task]

    def known(self, task: Task) -> Meta | None:
        """The numbers of an evaluation, None where a run that stopped has none."""
        return self._figures.get(task)

    @cached_property
    def _figures(self) -> dict[Task, Meta]:
        return {scored.task: scored.figures for scored in self.scored}


@dataclass(frozen=True)
class Picture:
    """A figure of the report: its task and what stands under it. One that ``leads`` may open the report."""

    task: Task
    caption: str
    leads: bool = False


@dataclass(frozen=True)
class Number:
    """A number of the first screen: what the ``paper`` says of it, and each run."""

    label: str
    paper: str
    here: Sequence[str]
    unit: str = "%"


@dataclass(frozen=True)
class Race:
    """Predictors, each under its label, that are shown beside the true car under one set of inputs.

    ``evaluation``: the first one's, whose test trajectory of mean error is shown; without it the car swerves.
    """

    ghosts: tuple[tuple[str, Task], ...]
    evaluation: Task | None = None


@dataclass(frozen=True)
class Lead:
    """What a method has to say on the first screen: its ``numbers``, the most telling first, a ``clause`` of the one
    sentence or None without scores, and the ``race`` of its predictors.
    """

    numbers: Callable[[Sequence[Run]], list[Number]]
    clause: Callable[[Run], str | None]
    race: Callable[[Experiment], Race]


@dataclass(frozen=True)
class Method:
    """One of the paper's methods."""

    name: str
    title: str
    cells: Callable[[Experiment], Iterator[tuple[Any, Task]]]
    """Every cell (a flat dataclass) of an experiment with its evaluation."""
    tables: Callable[[Sequence[Run]], list[Table]]
    """What is shown, paper versus here first."""
    notes: Callable[[Sequence[Run]], list[str]]
    """What the tables mean."""
    pictures: Callable[[Experiment], list[Picture]]
    """The figures of an experiment."""
    lead: Lead
    """What of it stands on the first screen."""
    fixed: Mapping[str, str]
    """Settings that the method sweeps over, and what to write instead."""
    measure: Callable[[Pipeline, Any, Task], Mapping[str, float]] | None = None
    """What is measured of a cell beside its evaluation."""


@dataclass(frozen=True)
class Plan:
    """What a run consists of: its cells, each with its evaluation, and its pictures."""

    method: Method
    run: Run
    cells: Sequence[tuple[Any, Task]]
    pictures: Sequence[Picture]

    @property
    def tasks(self) -> list[Task]:
        """Everything that is made: the evaluation of every cell, then the pictures."""
        return [*(task for _, task in self.cells), *(picture.task for picture in self.pictures)]


def planned(method: Method, run: Run) -> Plan:
    """The plan of a run, which takes a while to say."""
    return Plan(method, run, list(method.cells(run.experiment)), method.pictures(run.experiment))


def run_cells(plan: Plan, pipeline: Pipeline) -> Run:
    """Make or find every cell of a plan, with a progress display: the run with its scores."""
    method, scored = plan.method, []
    with pipeline.reporter.progress(f"reproduce {method.name}, {plan.run.label}") as progress:
        for i, (cell, task) in enumerate(plan.cells):
            progress(i, len(plan.cells))
            artefact = pipeline.make(task)
            measured = method.measure(pipeline, cell, task) if method.measure is not None else {}
            scored.append(Scored(cell, task, artefact.figures, artefact.record, measured))
    return replace(plan.run, scored=tuple(scored))


def cells_there(plan: Plan, pipeline: Pipeline) -> Run:
    """The run of a plan with the scores that the store has; nothing is made or measured."""
    kept = ((cell, task, pipeline.there(task)) for cell, task in plan.cells)
    scored = (
        Scored(cell, task, artefact.figures, artefact.record) for cell, task, artefact in kept if artefact is not None
    )
    return replace(plan.run, scored=tuple(scored))


def drawer(experiment: Experiment) -> Callable[..., Task]:
    """``(figure, artefacts, labels=…)`` -> its task for the report of an experiment, in the format that is smaller."""

    def draw(figure: str, artefacts: Sequence[Task], labels: Mapping[Task, str] | None = None) -> Task:
        image: ImageFormat = "png" if figure in RASTERS else "svg"
        return figure_tasks.figure(figure, artefacts, image, experiment, labels=labels)

    return draw
