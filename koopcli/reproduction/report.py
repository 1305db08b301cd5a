"""What a reproduction consists of: a method's cells, their scores, and the tables made of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from koopcli.config.experiment import Experiment
from koopcli.config.plants import UNUSED
from koopcli.records import Meta
from koopcli.stages.base import Task
from koopcli.stages.pipeline import Pipeline
from koopcli.store import Record

REDUCED = "This run is not of the paper's size: its figures cannot be put beside the paper's."


@dataclass(frozen=True)
class Table:
    """A table of texts: figures that stand in columns, the first ``left`` of which are names, or ``words`` of
    several lines that are read across.
    """

    title: str
    header: list[str]
    rows: list[list[str]]
    words: bool = False
    left: int = 1


@dataclass(frozen=True)
class Scored:
    """A cell of a method with the figures of its evaluation and the record that holds them."""

    cell: Any
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


@dataclass(frozen=True)
class Picture:
    """A figure of the report: its task and what stands under it."""

    task: Task
    caption: str


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
    fixed: Mapping[str, str]
    """Settings that the method sweeps over or fixes, and what to write instead."""
    uses: Callable[[str], bool]
    """Whether a setting has an effect on the method."""
    measure: Callable[[Pipeline, Any, Task], Mapping[str, float]] | None = None
    """What is measured of a cell beside its evaluation."""
    reads: Sequence[str] = ()
    """Settings of fits that some of its cells have a use for, whatever the experiment's own fit has."""


def tasks(method: Method, run: Run) -> list[Task]:
    """Everything a run makes: the evaluation of every cell, then the pictures."""
    pictures = method.pictures(run.experiment)
    return [*(task for _, task in method.cells(run.experiment)), *(picture.task for picture in pictures)]


def run_cells(method: Method, run: Run, pipeline: Pipeline) -> Run:
    """Make or find every cell of a run that has none yet, with a progress display."""
    scored = []
    cells = list(method.cells(run.experiment))
    with pipeline.reporter.progress(f"reproduce {method.name}, {run.label}") as progress:
        for i, (cell, task) in enumerate(cells):
            progress(i, len(cells))
            artefact = pipeline.make(task)
            measured = method.measure(pipeline, cell, task) if method.measure is not None else {}
            scored.append(Scored(cell, artefact.figures, artefact.record, measured))
    return replace(run, scored=tuple(scored))


def has_effect(name: str, *, plant: str, swept: Sequence[str], foreign: Sequence[str]) -> bool:
    """Whether the setting ``name`` has an effect on a method with this ``plant``.

    ``swept``: its settings of `reproduce`; ``foreign``: sections and tables that belong to the other methods.
    """
    section, _, key = name.partition(".")
    if section == "reproduce":
        return key in swept
    return not any(f"{name}.".startswith(f"{other}.") for other in (*UNUSED[plant], *foreign))


def full_table(method: Method, runs: Sequence[Run]) -> Table:
    """Every figure of every cell."""
    about = list(vars(runs[0].scored[0].cell))
    header = ["run", *about, "mean", "std", "median", "max", "start", "relift mean", "printed mean"]
    header += ["max yaw error (rad/s)", "worst in emptiest", "diverged", "artefact"]
    rows = []
    for run in runs:
        for scored in run.scored:
            figures = scored.figures
            numbers = [figures["rmse"][statistic] for statistic in ("mean", "std", "median", "max")]
            numbers += [figures[name]["mean"] for name in ("start_error", "rmse_relift", "rmse_printed")]
            numbers += [figures["max_error"]["yaw_rate"], figures["worst_in_emptiest"]]
            text = [f"{number:.4g}" for number in numbers]
            cell = [str(value) for value in vars(scored.cell).values()]
            rows.append([run.label, *cell, *text, str(figures["diverged"]), scored.record.name])
    return Table(f"Every evaluation of {method.title}, RMSE in %", header, rows)


def score_text(figures: Meta | None, unit: str = "", digits: int = 3) -> str:
    """``mean ± std (median)`` of the RMSE to ``digits``, the deviation to one less."""
    if figures is None:
        return "–"
    rmse = figures["rmse"]
    return f"{rmse['mean']:.{digits}g} ± {rmse['std']:.{digits - 1}g} ({rmse['median']:.{digits}g}){unit}"


def count_text(*numbers: int) -> str:
    """Counts with thousands apart, joined by a times sign."""
    return " × ".join(f"{number:,}".replace(",", " ") for number in numbers)
