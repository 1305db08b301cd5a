"""The command that sweeps: every combination of some settings, scored side by side."""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from koopcli.cli.completion import complete_setting
from koopcli.cli.invocation import Invocation, begin, describe, print_json
from koopcli.cli.options import (
    ClusterOption,
    DryRunOption,
    ExperimentOption,
    JsonOption,
    StoreOption,
    WorkersOption,
)
from koopcli.cli.outputs import STDOUT, OutputOption, check_outputs, image_format, write_outputs
from koopcli.config.changes import nested
from koopcli.config.experiment import load_experiment
from koopcli.config.grids import Grid, parse_grid
from koopcli.console import show_line, show_table
from koopcli.errors import InvalidValueError, KoopError, UsageError

if TYPE_CHECKING:
    from koopcli.config.pictures import ImageFormat
    from koopcli.koopman.scores.swept import Swept
    from koopcli.stages.base import Task
    from koopcli.stages.grid import Cell
    from koopcli.stages.pipeline import Artefact

MethodName = Literal["fit-edmd", "fit-eigen", "baseline"]
ROWS = 40  # of the table on the screen


def sweep(
    method: Annotated[
        MethodName | None,
        typer.Argument(
            metavar="fit-edmd|fit-eigen|baseline",
            help="What makes the predictors (the fit that the experiment is about, else fit-edmd).",
        ),
    ] = None,
    set_: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="STAGE.KEY=VALUES",
            autocompletion=complete_setting,
            help="A setting of any stage with the values to try: fit-edmd.order=1:12 (both ends), "
            "fit-edmd.terms=linear,bilinear, fit-edmd.ridge=0,1e-6,1e-4, sample.seed=0:29, vehicle.Jzz=1000:2000:250, "
            "or with one value for all. May be repeated; every combination is made.",
        ),
    ] = None,
    shard: Annotated[
        str | None,
        typer.Option(metavar="I/N", help="Make only the I-th of N parts of about the same cost, as in a job array."),
    ] = None,
    output: OutputOption = None,
    csv_: Annotated[
        Path | None,
        typer.Option("--csv", metavar="FILE", help="Write the scores of all cells, as a table; - writes it to stdout."),
    ] = None,
    workers: WorkersOption = 1,
    cluster: ClusterOption = None,
    experiment: ExperimentOption = "paper",
    store: StoreOption = None,
    dry_run: DryRunOption = False,
    as_json: JsonOption = False,
) -> None:
    """Fit and score a predictor for every combination of some settings.

    Every cell of the grid is an evaluation like any other, with its predictor and data: what is there is reused, and an
    interrupted sweep goes on where it stopped. Cells that fail, or whose settings do not go together, are left out and
    named. The sweep ends with a table, in which seeds count as repetitions, and a figure. With --shard the parts of a
    sweep may run anywhere that sees the store; the same command without it then puts all of them together.

    Example: koop sweep --set fit-edmd.order=1:12 --set sample.seed=0:29 --workers 4
    """
    grid = parse_grid(set_ or [])
    if not grid.axes:
        raise UsageError("what is swept? Give a setting several values, such as --set fit-edmd.order=1:12")
    part = _shard(shard)
    image = image_format(output)
    check_outputs(output, csv_, as_json=as_json)
    call = begin(store, experiment, None, (), None, workers, cluster)
    from koopcli.stages import grid as grids
    from koopcli.stages.pipeline import cost

    with call.console.progress("cells") as progress:
        every = grids.cells(grid, method, experiment, call.pipeline.check, progress)
    chosen = [cell for cell in every if not cell.refused]
    _say_left_out(call, grid, every)
    if part is not None:
        i, n = part
        chosen = grids.shared_out(chosen, n, lambda task: cost(task).seconds)[i - 1]
        if not chosen:
            raise InvalidValueError(f"--shard {i}/{n} has nothing to do: there are fewer than {n} cells")
    _say_what_vehicle(call, grid, experiment, chosen)
    if dry_run:
        _show_plan(call, [cell.task for cell in chosen], as_json=as_json)
        return
    call.console.note(f"store: {call.pipeline.store.root}")
    if len(chosen) < len(grid):
        call.console.note(f"{len(chosen)} of the {len(grid)} cells of the grid are made")
    with call.pipeline.workers:
        failed = _make(call, [cell.task for cell in chosen])
    made = [cell for cell in chosen if cell.task not in failed]
    for cell in chosen:
        if cell.task in failed:
            call.console.warn(f"{_line(cell.told(grid))} failed: {failed[cell.task]}")
    if not made:
        raise next(iter(failed.values()))
    artefact = call.pipeline.make(grids.sweep(grid, made))
    _show_scores(artefact.content)
    picture = _drawn(call, artefact, image)
    write_outputs(call.console, picture, output if picture else None, artefact.content, csv_)
    if picture and output is None:
        call.console.note(f"its figure: koop plot sweep {artefact.record.name} -o sweep.pdf")
    if as_json:
        records = [call.pipeline.found(cell.task) for cell in made]
        print_json(
            {
                **describe(artefact, call.pipeline.store.path(artefact.record)),
                "evaluations": [
                    {
                        "name": record.name,
                        "settings": cell.told(grid),
                        "same": [grids.words(grid, p) for p in cell.same],
                    }
                    for record, cell in zip(records, made, strict=True)
                    if record is not None
                ],
                "refused": [{"settings": c.told(grid), "reason": c.refused} for c in every if c.refused],
                "failed": [
                    {"settings": c.told(grid), "reason": str(failed[c.task])} for c in chosen if c.task in failed
                ],
            }
        )
    else:
        call.print_name(artefact.record.name, table_out=csv_ == STDOUT)
    if failed:
        raise InvalidValueError(
            f"{len(failed)} of {len(chosen)} cells failed and are not in the table: the warnings above say why"
        )


def _shard(text: str | None) -> tuple[int, int] | None:
    """Which part of how many."""
    if text is None:
        return None
    match = re.fullmatch(r"(\d{1,6})/(\d{1,6})", text.strip())
    if match is None or not 1 <= int(match[1]) <= int(match[2]):
        raise UsageError(f"--shard {text}: write I/N with I from 1 to N, such as --shard 3/8")
    return int(match[1]), int(match[2])


def _say_left_out(call: Invocation, grid: Grid, every: Sequence[Cell]) -> None:
    """Which cells are not made: those that come to the same as others, and those that cannot work."""
    from koopcli.stages.grid import words

    same = [(words(grid, place), cell.told(grid)) for cell in every for place in cell.same]
    if same:
        call.console.note(
            f"{len(same)} of {len(grid)} cells come to the same as others; the first, {_line(same[0][0])}, as "
            f"{_line(same[0][1])}"
        )
    refused = [cell for cell in every if cell.refused]
    if refused:
        first = refused[0]
        call.console.warn(
            f"{len(refused)} of {len(every)} cells cannot work and are left out; the first, {_line(first.told(grid))}: "
            f"{first.refused}"
        )


def _say_what_vehicle(call: Invocation, grid: Grid, base: str, chosen: Sequence[Cell]) -> None:
    """Of a vehicle that all cells have; where several are swept, cells that come to the same are said."""
    if "vehicle.name" in dict(grid.fixed):
        experiment = load_experiment(base, nested(grid.fixed))
        replace(call, experiment=experiment).say_what_vehicle([cell.task for cell in chosen])


def _line(told: Mapping[str, str]) -> str:
    return " ".join(f"{name}={value}" for name, value in told.items())


def _make(call: Invocation, tasks: Sequence[Task]) -> dict[Task, KoopError]:
    """Make all ``tasks``; returns those that cannot be made, and why."""
    from koopcli.stages.ahead import FATAL, make_ahead

    failed = make_ahead(call.pipeline, tasks)
    lost: dict[Task, KoopError] = {}
    with call.console.progress("sweep") as progress:
        for i, task in enumerate(tasks):
            behind = next((failed[step] for step in task.upstream() if step in failed), None)
            if behind is not None:
                lost[task] = behind
                continue
            try:
                call.pipeline.make(task)
            except FATAL:
                raise
            except KoopError as error:
                lost[task] = error
            progress(i + 1, len(tasks))
    return lost


def _show_plan(call: Invocation, tasks: Sequence[Task], *, as_json: bool) -> None:
    """What would be made and reused, by stage."""
    from koopcli.store.files import size_text

    steps = {step.task: step for task in tasks for step in call.pipeline.plan(task)}
    rows: dict[str, dict[str, float]] = {}
    for step in steps.values():
        for name in (step.task.stage, "total, roughly"):
            row = rows.setdefault(name, dict.fromkeys(("make", "reuse", "seconds", "bytes"), 0))
            row[step.state] += 1
            row["seconds"] += step.cost.seconds
            row["bytes"] += step.cost.bytes
    rows["total, roughly"] = rows.pop("total, roughly")  # comes last
    if as_json:
        print_json({"dry_run": True, "cells": len(tasks), "stages": rows})
        return
    table = [
        [name, f"{row['make']:.0f}", f"{row['reuse']:.0f}", f"{row['seconds']:.1f}", size_text(row["bytes"])]
        for name, row in rows.items()
    ]
    show_table([f"of {len(tasks)} cells", "make", "reuse", "seconds of one core", "size"], table)


def _show_scores(table: Swept) -> None:
    """A row for each cell, or for those that differ in a seed alone; beyond what fits a screen the best of them."""
    import numpy as np

    groups, mean = table.groups(), table.scores["mean"]
    seeds = any(len(group) > 1 for group in groups)
    if len(groups) > ROWS:
        worth = [np.nanmedian(mean[group]) if np.isfinite(mean[group]).any() else np.inf for group in groups]
        groups = [groups[i] for i in np.argsort(worth, kind="stable")[:ROWS]]
    shown = [name for name in table.names if not seeds or name.rpartition(".")[2] != "seed"]
    rows = []
    for group in groups:
        told, scores = table.told(group[0]), {name: column[group] for name, column in table.scores.items()}
        row = [told.get(name, "–") for name in shown]
        row.append(f"{scores['functions'][0]:.0f}")
        if seeds:
            finite = scores["mean"][np.isfinite(scores["mean"])]
            ends = [f(finite) if len(finite) else np.nan for f in (np.median, np.min, np.max)]
            row += [str(len(group)), *map(_percent, ends)]
        else:
            row += [_percent(scores[name][0]) for name in ("mean", "std", "median", "max")]
        row.append(f"{scores['diverged'].sum():.0f}")
        rows.append(row)
    over = ("seeds", "median", "least", "most") if seeds else ("mean", "std", "median", "max")
    title = "RMSE in %: mean over trajectories, spread over seeds" if seeds else "RMSE in %, over trajectories"
    header = [*shown, "functions", *over, "diverged"]
    show_table(header, rows, title=title, left=len(shown), file=sys.stderr)
    if len(table.groups()) > ROWS:
        show_line(f"the {ROWS} best of {len(table.groups())} rows; all are in koop show NAME --csv", sys.stderr)


def _percent(value: float) -> str:
    return f"{value:.4g}" if math.isfinite(value) else "–"


def _drawn(call: Invocation, artefact: Artefact, image: ImageFormat) -> bytes:
    """The figure of a sweep; nothing, and why, where there is none to draw."""
    from koopcli.stages import figure_tasks

    try:
        task = figure_tasks.figure("sweep", [call.pipeline.named(artefact.record.name)], image, call.experiment)
        drawing: bytes = call.pipeline.make(task).content.image
    except InvalidValueError as error:  # where all diverged
        call.console.warn(f"the figure is not drawn: {error}")
        return b""
    return drawing


def register(app: typer.Typer) -> None:
    """Add the command of this file."""
    app.command("sweep")(sweep)
