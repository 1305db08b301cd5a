"""The command that reproduces the paper and puts its figures beside the paper's."""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from koopcli.cli.invocation import Invocation, begin, print_json, show_plan, why_idle
from koopcli.cli.options import DryRunOption, ExperimentOption, JsonOption, SetOption, StoreOption
from koopcli.config.experiment import SECTIONS, Experiment, flat, load_experiment, nested
from koopcli.console import show_table
from koopcli.errors import UsageError

if TYPE_CHECKING:
    from koopcli.reproduction.report import Method, Run, Table
    from koopcli.stages.pipeline import Artefact

MethodName = Literal["all", "edmd", "eigen"]
NOT_HERE = ("sample.kind", "test.kind", "simulate.plant", "baseline.kind")


@dataclass(frozen=True)
class _Part:
    """One method of a reproduction with its runs, and the pictures of each with their captions."""

    method: Method
    runs: list[Run]
    pictures: list[tuple[Artefact, str]]


def reproduce(
    method: Annotated[
        MethodName,
        typer.Argument(
            metavar="all|edmd|eigen", help="edmd: polynomial bases; eigen: eigenfunctions from data; all: both."
        ),
    ] = "all",
    smoke: Annotated[bool, typer.Option("--smoke", help="Reduced datasets, in seconds (experiment 'smoke').")] = False,
    set_: SetOption = None,
    experiment: ExperimentOption = "paper",
    store: StoreOption = None,
    dry_run: DryRunOption = False,
    as_json: JsonOption = False,
) -> None:
    """Reproduce the paper at full size and put its figures beside those found here: EDMD over orders, training grids
    and test inputs; eigenfunctions over readings of the text, two tyres, cuts, grip and baselines.

    Some two minutes and 300 MB for both. What --set changes is shown beside the unmodified run. The tables, the
    figures and the names of all artefacts are written to a file, whose path is printed. All of it is pinned, with what
    it was made from.

    Example: koop reproduce eigen --set vehicle.mu_scale=0.8
    """
    if smoke and experiment != "paper":
        raise UsageError("--smoke is an experiment of its own: leave out --experiment")
    base = "smoke" if smoke else experiment
    call = begin(store, base, set_, SECTIONS)
    from koopcli.reproduction import report
    from koopcli.reproduction.registry import METHODS

    chosen = list(METHODS.values()) if method == "all" else [METHODS[method]]
    _refuse(call, chosen)
    runs = {one.name: _experiments(call, base, one) for one in chosen}
    if dry_run:
        tasks = [task for one in chosen for _, there in runs[one.name] for _, task in one.cells(there)]
        steps = {step.task: step for task in tasks for step in call.pipeline.plan(task)}
        show_plan(list(steps.values()), as_json=as_json)
        return
    for one in chosen:
        for _, there in runs[one.name]:
            for _, task in one.cells(there):
                call.pipeline.check(task)
    parts = []
    for one in chosen:
        done = [report.run_cells(one, there, call.pipeline, label) for label, there in runs[one.name]]
        drawn = [(call.pipeline.make(p.task), p.caption) for run in done for p in one.pictures(run, "png")]
        parts.append(_Part(one, done, drawn))
    _finish(call, method, parts, as_json=as_json)


def _refuse(call: Invocation, chosen: Sequence[Method]) -> None:
    """Refuse what the experiments fix, sweep over or have no use for."""
    for name, _ in flat(call.changes):
        if name.startswith("fit-") and (idle := why_idle(name, call.experiment, [])):
            raise UsageError(f"{name} changes nothing here: {idle}")
        if name in NOT_HERE:
            raise UsageError(f"reproduce has its own {name}: change it in the stages' own commands")
        for method in chosen:
            if name in method.fixed:
                raise UsageError(f"reproduce sweeps {name}: choose what it sweeps with --set '{method.fixed[name]}'")
        if not any(method.uses(name) for method in chosen):
            raise UsageError(f"--set {name} changes nothing in reproduce {' or '.join(one.name for one in chosen)}")
        section, _, key = name.partition(".")
        if len(chosen) > 1 and section in ("sample", "test") and "." not in key:
            kinds = "grid.{0} or sample.ellipsoid.{0}" if section == "sample" else "box.{0} or test.ball.{0}"
            raise UsageError(f"--set {name}: say which, {section}.{kinds.format(key)}")


def _experiments(call: Invocation, base: str, method: Method) -> list[tuple[str, Experiment]]:
    """The unmodified experiment, and the modified one beside it; a change of the sweep itself applies to both."""
    plan = {section: values for section, values in call.changes.items() if section == "reproduce"}
    used = [(name, value) for name, value in flat(call.changes) if method.uses(name)]
    changed = [f"{name}={value}" for name, value in used if not name.startswith("reproduce.")]
    runs = [("here", load_experiment(base, plan))]
    return [*runs, (" ".join(changed), load_experiment(base, nested(used)))] if changed else runs


def _finish(call: Invocation, name: str, parts: Sequence[_Part], *, as_json: bool) -> None:
    """Tables on stderr, the same with all details in a file, its path on stdout."""
    from koopcli.store.pins import pin

    for part in parts:
        for table in part.method.tables(part.runs):
            show_table(table.header, table.rows, title=table.title, file=sys.stderr)
        for note in part.method.notes(part.runs):
            call.console.note(note)
    label = f"reproduce-{name}-{_identity(parts)}"
    made = [scored.record for part in parts for run in part.runs for scored in run.scored]
    made += [drawn.record for part in parts for drawn, _ in part.pictures]
    pin(call.pipeline.store, label, call.pipeline.with_inputs(made))
    call.console.note(f"pinned as {label}")
    path = _write_report(call, name, parts)
    if as_json:
        runs = [_run_json(part.method, run) for part in parts for run in part.runs]
        print_json({"name": path.stem, "path": str(path), "runs": runs})
    else:
        print(path)


def _identity(parts: Sequence[_Part]) -> str:
    names = "\n".join(scored.record.name for part in parts for run in part.runs for scored in run.scored)
    return hashlib.sha256(names.encode()).hexdigest()[:12]


def _write_report(call: Invocation, name: str, parts: Sequence[_Part]) -> Path:
    from koopcli.reproduction.report import full_table
    from koopcli.store.files import publish, storage_errors

    root = call.pipeline.store.root
    path = root / "reports" / f"{name}-{_identity(parts)}.md"
    lines: list[str] = []
    content: dict[Path, bytes] = {}
    for part in parts:
        lines += [f"# Paper versus here: {part.method.title}", ""]
        for table in [*part.method.tables(part.runs), full_table(part.method, part.runs)]:
            lines += [f"## {table.title}", "", *_markdown(table), ""]
        lines += ["## What it means", "", *(f"* {note}" for note in part.method.notes(part.runs)), ""]
        for drawn, caption in part.pictures:
            picture = path.with_name(f"{path.stem}-{len(content)}.png")
            content[picture] = drawn.content.image
            lines += [f"![{caption}]({picture.name})", "", caption, ""]
    content[path] = "\n".join(lines).encode()
    with storage_errors(root):
        for target, what in content.items():
            if not target.is_file() or target.read_bytes() != what:
                publish(target, what, root / "tmp")
    return path


def _markdown(table: Table) -> list[str]:
    rows = [table.header, ["---", *("---:" for _ in table.header[1:])], *table.rows]
    return [f"| {' | '.join(row)} |" for row in rows]


def _run_json(method: Method, run: Run) -> dict[str, Any]:
    cells = [{**vars(s.cell), "name": s.record.name, **s.figures} for s in run.scored]
    return {"method": method.name, "run": run.label, "evaluations": cells}


def register(app: typer.Typer) -> None:
    """Add the command of this file."""
    app.command("reproduce", rich_help_panel="Reproduce")(reproduce)
