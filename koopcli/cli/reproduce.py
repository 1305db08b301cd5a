"""The command that reproduces the paper and puts its figures beside the paper's."""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from koopcli.cli.invocation import Invocation, begin, print_json, show_plan
from koopcli.cli.options import DryRunOption, ExperimentOption, JsonOption, SetOption, StoreOption
from koopcli.config.experiment import SECTIONS, Experiment, load_experiment
from koopcli.console import show_table
from koopcli.errors import UsageError

if TYPE_CHECKING:
    from koopcli.stages.comparison import Table
    from koopcli.stages.reproduction import Sweep

Method = Literal["edmd"]
SWEPT = {
    "fit-edmd.order": "reproduce.orders=[6,7]",
    "sample.draw": 'reproduce.draws=["even"]',
    "test.excitation": 'reproduce.excitations=["held"]',
}


def reproduce(
    method: Annotated[Method, typer.Argument(metavar="edmd", help="edmd: the paper's first method.")] = "edmd",
    smoke: Annotated[bool, typer.Option("--smoke", help="A reduced grid, in seconds (experiment 'smoke').")] = False,
    set_: SetOption = None,
    experiment: ExperimentOption = "paper",
    store: StoreOption = None,
    dry_run: DryRunOption = False,
    as_json: JsonOption = False,
) -> None:
    """Reproduce the paper at full size: every order, training draw and kind of test inputs, beside its figures.

    What --set changes is shown beside the unmodified run. The tables, the figure and the names of all artefacts
    are written to a file, whose path is printed. All of it is pinned, with what it was made from.

    Example: koop reproduce edmd --set vehicle.Jzz=1731
    """
    if smoke and experiment != "paper":
        raise UsageError("--smoke is an experiment of its own: leave out --experiment")
    base = "smoke" if smoke else experiment
    call = begin(store, base, set_, SECTIONS)
    changes = [f"{section}.{key}" for section, values in call.changes.items() for key in values]
    for name in changes:
        if name in SWEPT:
            raise UsageError(f"reproduce sweeps {name}: choose what it sweeps with --set '{SWEPT[name]}'")
    from koopcli.stages import reproduction

    runs = _runs(call, base)
    if dry_run:
        tasks = [task for _, one in runs for _, task in reproduction.sweep_tasks(one)]
        steps = {step.task: step for task in tasks for step in call.pipeline.plan(task)}
        show_plan(list(steps.values()), as_json=as_json)
        return
    for _, one in runs:
        for _, task in reproduction.sweep_tasks(one):
            call.pipeline.check(task)
    sweeps = [(label, reproduction.run_sweep(one, call.pipeline, f"reproduce, {label}")) for label, one in runs]
    _finish(call, sweeps, as_json=as_json)


def _runs(call: Invocation, base: str) -> list[tuple[str, Experiment]]:
    """The unmodified experiment, and the modified one beside it; a change of the sweep itself applies to both."""
    plan = {section: values for section, values in call.changes.items() if section == "reproduce"}
    changed = [
        f"{section}.{key}={value}"
        for section, values in call.changes.items()
        if section != "reproduce"
        for key, value in values.items()
    ]
    runs = [("here", load_experiment(base, plan))]
    return [*runs, (" ".join(changed), call.experiment)] if changed else runs


def _finish(call: Invocation, sweeps: list[tuple[str, Sweep]], *, as_json: bool) -> None:
    """Tables on stderr, the same with all details in a file, its path on stdout."""
    from koopcli.stages import comparison, reproduction
    from koopcli.store.pins import pin

    figures = [reproduction.sweep_figure(sweep.experiment, call.pipeline) for _, sweep in sweeps]
    tables = [comparison.paper_table(sweeps), *comparison.order_tables(sweeps)]
    for table in tables:
        show_table(table.header, table.rows, title=table.title, file=sys.stderr)
    for note in comparison.notes(sweeps):
        call.console.note(note)
    label = f"reproduce-edmd-{_identity(sweeps)}"
    made = [scored.record for _, sweep in sweeps for scored in sweep.scored]
    made += [figure.record for figure in figures]
    pin(call.pipeline.store, label, call.pipeline.with_inputs(made))
    call.console.note(f"pinned as {label}")
    path = _write_report(
        call, sweeps, [*tables, comparison.full_table(sweeps)], [figure.content.image for figure in figures]
    )
    if as_json:
        print_json(
            {
                "name": path.stem,
                "path": str(path),
                "runs": [_run_json(label, sweep) for label, sweep in sweeps],
            }
        )
    else:
        print(path)


def _identity(sweeps: Sequence[tuple[str, Sweep]]) -> str:
    names = "\n".join(scored.record.name for _, sweep in sweeps for scored in sweep.scored)
    return hashlib.sha256(names.encode()).hexdigest()[:12]


def _write_report(call: Invocation, sweeps: list[tuple[str, Sweep]], tables: list[Table], images: list[bytes]) -> Path:
    from koopcli.stages.comparison import notes
    from koopcli.store.files import publish, storage_errors

    root = call.pipeline.store.root
    path = root / "reports" / f"edmd-{_identity(sweeps)}.md"
    lines = ["# EDMD: paper versus here", ""]
    for table in tables:
        lines += [f"## {table.title}", "", *_markdown(table), ""]
    lines += ["## What it means", "", *(f"* {note}" for note in notes(sweeps)), ""]
    pictures = [path.with_name(f"{path.stem}-{i}.png") for i in range(len(images))]
    for (label, _), picture in zip(sweeps, pictures, strict=True):
        lines += [f"![RMSE against order, {label}]({picture.name})", "", f"RMSE against order: {label}", ""]
    content = {path: "\n".join(lines).encode(), **dict(zip(pictures, images, strict=True))}
    with storage_errors(root):
        for target, what in content.items():
            if not target.is_file() or target.read_bytes() != what:
                publish(target, what, root / "tmp")
    return path


def _markdown(table: Table) -> list[str]:
    rows = [table.header, ["---", *("---:" for _ in table.header[1:])], *table.rows]
    return [f"| {' | '.join(row)} |" for row in rows]


def _run_json(label: str, sweep: Sweep) -> dict[str, Any]:
    cells = [{**vars(s.cell), "name": s.record.name, **s.figures} for s in sweep.scored]
    return {"run": label, "evaluations": cells}


def register(app: typer.Typer) -> None:
    """Add the command of this file."""
    app.command("reproduce", rich_help_panel="Reproduce")(reproduce)
