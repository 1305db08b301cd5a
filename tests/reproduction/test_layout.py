"""Scores stand where their cells' fields say, whichever run has them."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace

from koopcli.config.experiment import load_experiment
from koopcli.reproduction import beyond_cells, headlines
from koopcli.reproduction.layout import Column, by_vehicle, crossed
from koopcli.reproduction.report import Run, Scored
from koopcli.stages.base import Task


@dataclass(frozen=True)
class Cell:
    block: str
    label: str
    vehicle: str


def run_of(label, *cells):
    scored = [Scored(cell, Task("evaluate", i), {"number": i}, SimpleNamespace()) for i, cell in enumerate(cells)]
    return Run(label, load_experiment("smoke", {}), tuple(scored))


def numbers(scores):
    return [None if scored is None else scored.figures["number"] for scored in scores]


def test_rows_are_in_the_order_of_cells_and_of_their_block_alone():
    run = run_of("here", Cell("a", "x", "v"), Cell("b", "x", "v"), Cell("a", "y", "v"), Cell("a", "x", "w"))
    rows = crossed(run, ("label",), "vehicle", "a")
    assert {key: {name: one.figures["number"] for name, one in row.items()} for key, row in rows.items()} == {
        ("x",): {"v": 0, "w": 3},
        ("y",): {"v": 2},
    }


def test_runs_stand_side_by_side_and_what_one_has_not_is_left_open():
    here, changed = run_of("here", Cell("a", "x", "v")), run_of("mu=1", Cell("a", "z", "v"), Cell("a", "x", "v"))
    shown = [Column(run, "v", run.experiment) for run in (here, changed)]
    assert [column.heading for column in shown] == ["v", "v, mu=1"]
    rows = by_vehicle(shown, "a", "label")
    assert {key: numbers(scores) for key, scores in rows.items()} == {("x",): [0, 1], ("z",): [None, 0]}


def test_a_rung_of_the_ladder_is_not_taken_for_the_best_where_a_run_stopped():
    experiment = load_experiment("smoke", {})
    figures = {"rmse": {"mean": 24.0, "std": 12.0}}
    cell, task = next(beyond_cells.cells(experiment))
    stopped = Run("here", experiment, (Scored(cell, task, figures, SimpleNamespace()),))
    assert headlines.BEYOND.numbers([stopped]) == []
    assert headlines.BEYOND.clause(stopped) is None
    best = Scored(cell, beyond_cells.best(experiment, 0), figures, SimpleNamespace())
    (number,) = headlines.BEYOND.numbers([Run("here", experiment, (best,))])
    assert (number.label, number.here) == ("best-eigen, ctu-2020", ["24.0 ± 12"])
