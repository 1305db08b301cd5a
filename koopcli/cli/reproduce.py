"""The command that reproduces the paper and puts its figures beside the paper's."""

from __future__ import annotations

import hashlib
import shlex
import sys
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from koopcli.cli.invocation import Invocation, begin, print_json, show_plan
from koopcli.cli.options import (
    ClusterOption,
    DryRunOption,
    ExperimentOption,
    JsonOption,
    SetOption,
    StoreOption,
    WorkersOption,
)
from koopcli.config.changes import SECTIONS, flat, short_name
from koopcli.config.experiment import Experiment, load_experiment
from koopcli.console import show_table
from koopcli.errors import KoopError, UsageError

if TYPE_CHECKING:
    from koopcli.reproduction.ghosts import Shown
    from koopcli.reproduction.illustrations import Illustration
    from koopcli.reproduction.opening import Part
    from koopcli.reproduction.report import Method, Plan, Race, Run
    from koopcli.stages.base import Task

MethodName = Literal["all", "edmd", "eigen"]
NOT_HERE = ("sample.kind", "test.kind", "simulate.plant", "baseline.kind", "evaluate.restart")


def reproduce(
    method: Annotated[
        MethodName,
        typer.Argument(
            metavar="all|edmd|eigen", help="edmd: polynomial bases; eigen: eigenfunctions from data; all: both."
        ),
    ] = "all",
    smoke: Annotated[bool, typer.Option("--smoke", help="Reduced datasets, in seconds (experiment 'smoke').")] = False,
    full: Annotated[
        bool,
        typer.Option(
            "--full", help="edmd: also the best order over 30 random training grids (minutes more, and 1.4 GB)."
        ),
    ] = False,
    beyond: Annotated[
        bool,
        typer.Option(
            "--beyond",
            help="eigen: also what goes beyond the paper, from its error to the best, with what each step costs and "
            "buys (minutes more).",
        ),
    ] = False,
    workers: WorkersOption = 1,
    cluster: ClusterOption = None,
    set_: SetOption = None,
    experiment: ExperimentOption = "paper",
    store: StoreOption = None,
    dry_run: DryRunOption = False,
    as_json: JsonOption = False,
) -> None:
    """Reproduce the paper at full size and put its numbers beside those found here: EDMD over orders, training grids
    and test inputs; eigenfunctions over readings of the text, two tyres, cuts, grip and baselines.

    The paper's claims about EDMD come first, each with a verdict and the command that shows it. Three to six minutes
    and 700 MB for both, by the machine. What --set changes is shown beside the unmodified run. It ends with
    report.html, whose path is printed: one page that opens with the main numbers and an animation of the predictors,
    then has every figure with the command that makes it, and the tables. All of it is pinned, with what it was made
    from.

    Example: koop reproduce eigen --set vehicle.mu_scale=0.8
    """
    if smoke and experiment != "paper":
        raise UsageError("--smoke is an experiment of its own: leave out --experiment")
    base = "smoke" if smoke else experiment
    call = begin(store, base, set_, SECTIONS, {"reproduce": {"full": True if full else None}}, workers, cluster)
    from koopcli.reproduction import ghosts, opening, report
    from koopcli.reproduction.illustrations import illustrate
    from koopcli.reproduction.registry import BEYOND, METHODS
    from koopcli.stages.ahead import make_ahead

    chosen = list(METHODS.values()) if method == "all" else [METHODS[method]]
    if beyond and method == "edmd":
        raise UsageError("--beyond belongs to eigenfunctions: koop reproduce eigen --beyond")
    chosen += [BEYOND] if beyond else []
    _refuse(call, chosen)
    plans = _plans(call, base, chosen)
    race = opening.race(chosen, plans[chosen[0].name][0].run)
    everything = [task for some in plans.values() for plan in some for task in plan.tasks]
    call.say_what_vehicle(everything)
    racing = _possible(call, race)
    if dry_run:
        steps = {step.task: step for task in (*everything, *racing) for step in call.pipeline.plan(task)}
        show_plan(list(steps.values()), as_json=as_json)
        return
    for task in everything:
        call.pipeline.check(task)
    parts = []
    try:
        with call.pipeline.workers:
            make_ahead(call.pipeline, [*everything, *racing])
            for selected in chosen:
                done = [report.run_cells(plan, call.pipeline) for plan in plans[selected.name]]
                parts.append(opening.Part(selected, done, illustrate(plans[selected.name], call.pipeline)))
            shown = ghosts.run(race, parts[0].runs[0].experiment, call.pipeline)
    except KeyboardInterrupt:
        with suppress(KoopError):  # such as a full disk: it stays an interrupt
            _show_what_there_is(call, method, list(plans.values()))
        raise
    _finish(call, method, parts, shown, racing, as_json=as_json)


def _possible(call: Invocation, race: Race) -> list[Task]:
    """The predictors of a race; none where one of them cannot be made, which the report says."""
    tasks = [task for _, task in race.ghosts]
    try:
        for task in tasks:
            call.pipeline.check(task)
    except KoopError:
        return []
    return tasks


def _tasks(method: Method, experiment: Experiment) -> list[Task]:
    """All that a method makes of an experiment."""
    from koopcli.reproduction.report import Run, planned

    return planned(method, Run("here", experiment, (), "")).tasks


def _refuse(call: Invocation, chosen: Sequence[Method]) -> None:
    """Refuse what the experiments fix or sweep over."""
    for name, _ in flat(call.changes):
        if name in NOT_HERE:
            raise UsageError(f"reproduce has its own {name}: change it in the stages' own commands")
        for method in chosen:
            if instead := method.fixed.get(short_name(name)):
                raise UsageError(f"reproduce sweeps {name}: choose what it sweeps with --set '{instead}'")
        section, _, key = name.partition(".")
        if (
            len({method.name for method in chosen} - {"beyond"}) > 1
            and section in ("sample", "test")
            and "." not in key
        ):
            kinds = "grid.{0} or sample.ellipsoid.{0}" if section == "sample" else "box.{0} or test.ball.{0}"
            raise UsageError(f"--set {name}: say which, {section}.{kinds.format(key)}")


def _plans(call: Invocation, base: str, chosen: Sequence[Method]) -> dict[str, list[Plan]]:
    """Of each method the plan of the unmodified experiment, and beside it that of the modified one where that differs;
    a change of the sweep itself applies to both. Raises ``UsageError`` for a change that makes no difference.
    """
    from koopcli.reproduction.report import Run, planned
    from koopcli.stages.effects import why_idle

    swept = {section: values for section, values in call.changes.items() if section == "reproduce"}
    plain = load_experiment(base, swept)
    plans: dict[str, list[Plan]] = {}
    useless = dict(flat(call.changes))
    for method in chosen:
        changed = planned(method, Run("here", call.experiment, (), base))
        used = {}
        for name, value in flat(call.changes):
            why = why_idle(name, call.experiment, lambda experiment: _tasks(method, experiment), changed.tasks)  # noqa: B023
            if why is None:
                used[name] = value
                useless.pop(name, None)
        sets = [f"{name}={str(value).lower() if isinstance(value, bool) else value}" for name, value in used.items()]
        sweep = tuple(change for change in sets if change.startswith("reproduce."))
        changes = tuple(change for change in sets if not change.startswith("reproduce."))
        here = planned(method, Run("here", plain, (), base, sweep))
        plans[method.name] = [here]
        if here.tasks != changed.tasks:
            label = " ".join(changes)
            plans[method.name].append(replace(changed, run=Run(label, call.experiment, (), base, (*sweep, *changes))))
    for name in useless:
        raise UsageError(f"--set {name} changes nothing in reproduce {' or '.join(method.name for method in chosen)}")
    return plans


def _show_what_there_is(call: Invocation, name: str, plans: Sequence[Sequence[Plan]]) -> None:
    """A report of a run that is interrupted: its first screen, and the scores and figures made so far."""
    from koopcli.reproduction.illustrations import illustrations_there
    from koopcli.reproduction.opening import Part
    from koopcli.reproduction.report import cells_there

    reason = "the run was interrupted"
    parts = []
    for some in plans:
        runs = [cells_there(plan, call.pipeline) for plan in some]
        pictures = illustrations_there(some, call.pipeline, reason)
        parts.append(Part(some[0].method, runs, pictures, sum(len(plan.cells) for plan in some)))
    if any(run.scored for part in parts for run in part.runs):
        path = _write_report(call, name, parts, reason, "interrupted")
        call.console.note(f"a report of what there is so far: {path}")


def _finish(
    call: Invocation, name: str, parts: Sequence[Part], shown: Shown | str, racing: Sequence[Task], *, as_json: bool
) -> None:
    """Tables on stderr, the same with all figures on a page, its path on stdout."""
    from koopcli.store.pins import pin

    for part in parts:
        for table in part.method.tables(part.runs):
            left = len(table.header) if table.words else table.left
            show_table(table.header, table.rows, title=table.title, left=left, lines=True, file=sys.stderr)
        for note in part.method.notes(part.runs):
            call.console.note(note)
        for picture in part.illustrations:
            if picture.drawing is None:
                call.console.warn(f"the figure '{picture.figure}' is not drawn: {picture.reason}")
    label = f"reproduce-{name}-{_identity(parts)}"
    made = [scored.record for part in parts for run in part.runs for scored in run.scored]
    made += [picture.record for part in parts for picture in part.illustrations if picture.record is not None]
    made += [] if isinstance(shown, str) else [call.pipeline.make(task).record for task in racing]
    pin(call.pipeline.store, label, call.pipeline.with_inputs(made))
    call.console.note(f"pinned as {label}")
    path = _write_report(call, name, parts, shown)
    if as_json:
        runs = [_run_json(part.method, run) for part in parts for run in part.runs]
        figures = [_figure_json(part.method, picture) for part in parts for picture in part.illustrations]
        print_json({"name": path.parent.name, "path": str(path), "runs": runs, "figures": figures})
    else:
        print(path)


def _identity(parts: Sequence[Part]) -> str:
    """What tells a report from others: the artefacts it shows."""
    names = [scored.record.name for part in parts for run in part.runs for scored in run.scored]
    names += [picture.record.name for part in parts for picture in part.illustrations if picture.record is not None]
    return hashlib.sha256("\n".join(names).encode()).hexdigest()[:12]


def _write_report(
    call: Invocation, name: str, parts: Sequence[Part], shown: Shown | str, identity: str | None = None
) -> Path:
    from koopcli import __version__
    from koopcli.reproduction.layout import full_table
    from koopcli.reproduction.opening import opening
    from koopcli.reproduction.page import Section, page
    from koopcli.store.files import publish, storage_errors, sync_young

    root = call.pipeline.store.root
    path = root / "reports" / f"{name}-{identity or _identity(parts)}" / "report.html"
    sections = [
        Section(
            part.method.name,
            f"{part.method.title[0].upper()}{part.method.title[1:]}",
            part.method.tables(part.runs) if part.whole else [],
            part.method.notes(part.runs) if part.whole else [],
            [picture for picture in part.illustrations if part.planned is None or picture.drawing is not None],
            full_table(part.method, part.runs),
        )
        for part in parts
    ]
    beyond = ["--beyond"] if any(part.method.name == "beyond" for part in parts) else []
    command = shlex.join(["koop", "reproduce", name, *beyond, *_told(parts)])
    version = f"koop {__version__}"
    content = page(opening(parts, shown, version), sections, command, version).encode()
    with storage_errors(root):
        if path.is_file() and path.read_bytes() == content:
            sync_young(path)
        else:
            publish(path, content, root / "tmp")
    return path


def _told(parts: Sequence[Part]) -> list[str]:
    """Experiment and changes, as they are said on the command line."""
    runs = [run for part in parts for run in part.runs]
    experiment = [] if runs[0].base == "paper" else ["--experiment", runs[0].base]
    changes = dict.fromkeys(change for run in runs for change in run.changes)
    return [*experiment, *(word for change in changes for word in ("--set", change))]


def _run_json(method: Method, run: Run) -> dict[str, Any]:
    cells = [{**vars(s.cell), "name": s.record.name, **s.measured, **s.figures} for s in run.scored]
    return {"method": method.name, "run": run.label, "evaluations": cells}


def _figure_json(method: Method, picture: Illustration) -> dict[str, Any]:
    name = None if picture.record is None else picture.record.name
    about = {"figure": picture.figure, "name": name, "caption": picture.caption, "command": picture.command}
    return {"method": method.name, "run": picture.run, **about}


def register(app: typer.Typer) -> None:
    """Add the command of this file."""
    app.command("reproduce")(reproduce)
