"""What every making command does: settings in, one task made or planned, its name out."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from koopcli.choices import written
from koopcli.config.changes import Changes, flat, nested, parse_set
from koopcli.console import Console, show_table
from koopcli.errors import InvalidValueError, UnknownNameError, UsageError
from koopcli.text import printable

if TYPE_CHECKING:
    from koopcli.config.experiment import Experiment
    from koopcli.config.settings import Simulate
    from koopcli.stages.base import Task
    from koopcli.stages.effects import Plan
    from koopcli.stages.pipeline import Artefact, Pipeline, Step


BRIEF = 40  # letters of a setting in one line: longer ones are digests, and the maps of logs
DATA = ("sample", "vehicle", "simulate")  # the sections behind trajectories


@dataclass(frozen=True)
class Invocation:
    """The store, the console and the experiment of one command."""

    pipeline: Pipeline
    console: Console
    experiment: Experiment
    changes: Changes

    def named(self, text: str, kinds: Sequence[str], role: str, unaffected: Sequence[str]) -> Task:
        """The task of an artefact the user named as ``role``.

        Raises ``UnknownNameError`` for another kind, ``UsageError`` when the command also changes settings of
        stages other than ``unaffected``, which the named artefact has behind it.
        """
        task = self.pipeline.named(text)
        if task.stage not in kinds:
            raise UnknownNameError(
                f"{text} is an artefact of stage {task.stage}; {role} must be of stage {' or '.join(kinds)}"
            )
        fixed = [name for name, _ in flat(self.changes) if name.partition(".")[0] not in unaffected]
        if fixed:
            raise UsageError(f"{text} is made already: {', '.join(fixed)} cannot change it; leave out one or the other")
        return task

    def optional(self, text: str | None, kinds: Sequence[str], role: str, unaffected: Sequence[str]) -> Task | None:
        """As :meth:`named`; None where the user named nothing, which an empty text is not."""
        return None if text is None else self.named(text, kinds, role, unaffected)

    def simulated(self, predictor: Task) -> Simulate:
        """The simulation behind ``predictor``, which remembers it when its trajectories are gone."""
        from koopcli.stages.recipes import remembered_simulation

        simulation = predictor.find("simulate")
        if simulation is not None:
            settings: Simulate = simulation.settings
            return settings
        content = self.pipeline.make(predictor).content
        if not content.plant:
            raise InvalidValueError(f"{predictor.name} was fitted to a log: there is no simulated car behind it")
        return remembered_simulation(content.plant, content.dt)

    def refuse_idle(self, plan: Plan, tasks: Sequence[Task]) -> None:
        """Raise ``UsageError`` for a change that has no effect on the ``tasks`` that ``plan`` makes."""
        from koopcli.stages.effects import why_idle

        for name, _ in flat(self.changes):
            if idle := why_idle(name, self.experiment, plan, tasks):
                raise UsageError(f"{name} changes nothing here: {idle}")

    def say_what_vehicle(self, tasks: Sequence[Task]) -> None:
        """Note where the vehicle that was named makes the same as another would."""
        from koopcli.stages.vehicle import makes_the_same

        if text := makes_the_same(self.experiment, tasks):
            self.console.note(text)

    def run(
        self,
        make: Callable[[Experiment], Task],
        *,
        as_json: bool,
        dry_run: bool,
        extra: Callable[[Artefact], Mapping[str, Any] | None] | None = None,
        also: Sequence[Task] = (),
        table_out: bool = False,
    ) -> None:
        """Make the task that ``make`` plans of the experiment and print its name, or print the plan.

        ``extra`` does the rest with the artefact and may return more for its JSON, ``also``: what it makes;
        ``table_out``: whether stdout has the table of the artefact.
        """
        task = make(self.experiment)
        self.refuse_idle(lambda experiment: [make(experiment)], [task])
        self.say_what_vehicle([task])
        if dry_run:
            steps = {step.task: step for wanted in (task, *also) for step in self.pipeline.plan(wanted)}
            show_plan(list(steps.values()), as_json=as_json)
            return
        for wanted in also:
            self.pipeline.check(wanted)
        self.console.note(f"store: {self.pipeline.store.root}")
        with self.pipeline.workers:
            artefact = self.pipeline.make(task)
            more = extra(artefact) if extra is not None else None
        if as_json:
            print_json({**describe(artefact, self.pipeline.store.path(artefact.record)), **(more or {})})
        else:
            self.print_name(artefact.record.name, table_out=table_out)

    def print_name(self, name: str, *, table_out: bool) -> None:
        """Print the ``name`` of what was made, on stderr where stdout has its table."""
        if table_out:
            self.console.note(name)
        else:
            print(name)


def begin(
    store: Path | None,
    experiment: str,
    assignments: Sequence[str] | None,
    sections: Sequence[str],
    options: Changes | None = None,
    workers: int = 1,
    cluster: str | None = None,
) -> Invocation:
    """What a command works with; its ``options`` win over ``--set``, which wins over the experiment file.

    ``sections``: those whose settings the command uses; ``--set`` of any other is refused. ``workers``: how many
    processes share the work, or those of a Dask ``cluster`` by its address.
    """
    from koopcli.config.experiment import load_experiment
    from koopcli.stages.pipeline import Pipeline
    from koopcli.stages.workers import Workers

    sharing = Workers(workers, cluster)
    told = [(f"{section}.{key}", v) for section, values in (options or {}).items() for key, v in values.items()]
    changes = nested([*flat(parse_set(assignments or [])), *((name, v) for name, v in told if v is not None)])
    for name, _ in flat(changes):
        if name.partition(".")[0] not in sections:
            raise UsageError(f"--set {name} changes nothing here; this command uses {', '.join(sections)}")
    loaded = load_experiment(experiment, changes)
    console, shelf = open_store(store)
    return Invocation(Pipeline(shelf, console, sharing), console, loaded, changes)


def open_store(store: Path | None) -> tuple[Console, Any]:
    """The console and the store."""
    from koopcli.store import Store, store_root

    console = Console()
    return console, Store(store_root(store), console.warn)


def describe(artefact: Artefact, path: Path) -> dict[str, Any]:
    """The JSON of a making command."""
    return {
        "name": artefact.record.name,
        "path": str(path),
        "cached": artefact.cached,
        "seconds": round(artefact.seconds, 3),
        **artefact.figures,
    }


def print_json(value: object) -> None:
    """One JSON value on stdout; what is not a finite number becomes null, what would steer a terminal an escape."""
    lines = json.dumps(_finite(value), indent=1, ensure_ascii=False).split("\n")
    print("\n".join(line if line.isprintable() else "".join(map(_escaped, line)) for line in lines))


def write_csv(content: Any, file: IO[str]) -> None:
    """The table of an artefact's ``content``; on a terminal nothing of it steers that."""
    header, rows = content.table()
    writer = csv.writer(file, lineterminator="\n")
    for row in chain([header], rows):
        writer.writerow([_shown(cell) for cell in row] if file.isatty() else row)


def show_plan(steps: Sequence[Step], *, as_json: bool) -> None:
    """The table of a dry run, on stdout."""
    from koopcli.store.files import size_text

    seconds, size = sum(step.cost.seconds for step in steps), sum(step.cost.bytes for step in steps)
    if as_json:
        rows = [
            {"name": step.name, "action": step.state, **vars(step.cost), "settings": written(step.task.settings)}
            for step in steps
        ]
        print_json({"dry_run": True, "steps": rows, "seconds": round(seconds, 2), "bytes": round(size)})
        return
    table = []
    for step in steps:
        made = step.state == "make"
        cost = (f"{step.cost.seconds:.1f}", size_text(step.cost.bytes)) if made else ("", "")
        table.append([step.name, step.state, brief(written(step.task.settings)), *cost])
    table.append(["total, roughly", "", "", f"{seconds:.1f}", size_text(size)])
    show_table(["artefact", "action", "settings", "seconds", "size"], table, left=3)


def brief(settings: dict[str, Any]) -> str:
    """Settings in one short text, without nested ones, and without digests and maps."""
    plain = {key: value for key, value in settings.items() if not isinstance(value, (dict, list, tuple))}
    return " ".join(f"{key}={value}" for key, value in plain.items() if len(str(value)) <= BRIEF)


def _shown(cell: Any) -> Any:
    return printable(cell) if isinstance(cell, str) else cell


def _escaped(character: str) -> str:
    return character if character.isprintable() else json.dumps(character)[1:-1]


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(v) for key, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(v) for v in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
