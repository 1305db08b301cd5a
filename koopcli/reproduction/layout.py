"""Scores laid out in tables: by their cells' own fields in rows, across which stand other fields, runs and vehicles."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from koopcli.config.experiment import Experiment
from koopcli.reproduction.report import Method, Run, Scored, Table
from koopcli.reproduction.texts import number_text, score_text, statistic_text
from koopcli.stages import recipes

Vehicles = list[tuple[str, Experiment]]


@dataclass(frozen=True)
class Column:
    """A vehicle of a run, under its name, with its own experiment."""

    run: Run
    vehicle: str
    experiment: Experiment

    @property
    def heading(self) -> str:
        """What stands over it."""
        return self.vehicle if self.run.label == "here" else f"{self.vehicle}, {self.run.label}"


def columns(runs: Sequence[Run], vehicles: Callable[[Experiment], Vehicles] = recipes.vehicles) -> list[Column]:
    """A column for each of the ``vehicles`` of each run."""
    return [Column(run, name, experiment) for run in runs for name, experiment in vehicles(run.experiment)]


def crossed(run: Run, rows: Sequence[str], across: str, *blocks: str) -> dict[tuple[Any, ...], dict[Any, Scored]]:
    """The scores of ``blocks``: a row for each value of the fields ``rows`` of their cells, and in it one for each
    value of the field ``across``.
    """
    lines: dict[tuple[Any, ...], dict[Any, Scored]] = {}
    for scored in run.scored:
        fields = vars(scored.cell)
        if fields["block"] in blocks:
            lines.setdefault(tuple(fields[name] for name in rows), {}).setdefault(fields[across], scored)
    return lines


def by_vehicle(shown: Sequence[Column], block: str, *rows: str) -> dict[tuple[Any, ...], list[Scored | None]]:
    """The scores of a block: a row for each value of the fields ``rows`` of its cells, across the columns ``shown``."""
    lines = {column.run.label: crossed(column.run, rows, "vehicle", block) for column in shown}
    keys = dict.fromkeys(key for run in lines.values() for key in run)
    return {key: [lines[column.run.label].get(key, {}).get(column.vehicle) for column in shown] for key in keys}


def vehicle_table(title: str, names: Sequence[str], shown: Sequence[Column], rows: list[list[str]]) -> Table:
    """A table of rows that begin with ``names`` and go on with a text for each vehicle."""
    return Table(title, [*names, *(column.heading for column in shown)], rows)


def score_texts(scores: Sequence[Scored | None]) -> list[str]:
    """Scores of a row as ``mean ± std (median)``."""
    return [score_text(None if scored is None else scored.figures) for scored in scores]


def labelled(shown: Sequence[Column], block: str) -> list[list[str]]:
    """A row for each label of a block."""
    return [[label, *score_texts(scores)] for (label,), scores in by_vehicle(shown, block, "label").items()]


def full_table(method: Method, runs: Sequence[Run]) -> Table:
    """Every number of every cell."""
    cells = [scored.cell for run in runs for scored in run.scored]
    about = list(vars(cells[0])) if cells else []
    header = ["run", *about, "mean", "std", "median", "max", "start", "re-lifted", "as printed"]
    header += ["max yaw error (rad/s)", "worst in emptiest", "diverged", "artefact"]
    rows = []
    for run in runs:
        for scored in run.scored:
            figures = scored.figures
            numbers = [statistic_text(figures, name) for name in ("mean", "std", "median", "max")]
            others = [figures[name]["mean"] for name in ("start_error", "rmse_relift", "rmse_printed")]
            others += [figures["max_error"]["yaw_rate"], figures["worst_in_emptiest"]]
            cell = ["" if value is None else str(value) for value in vars(scored.cell).values()]
            rows.append(
                [run.label, *cell, *numbers, *map(number_text, others), str(figures["diverged"]), scored.record.name]
            )
    title = f"Every evaluation of {method.title}, RMSE in %"
    return Table(title, header, rows, left=1 + len(about))
