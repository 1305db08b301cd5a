"""What every making command does: settings in, one task made or planned, its name out."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from koopcli.config.experiment import Changes, Experiment, flat, load_experiment, parse_set
from koopcli.config.samples import OF_VEHICLE
from koopcli.config.settings import UNUSED, FitEdmd, FitEigen
from koopcli.console import Console, show_table
from koopcli.errors import UnknownNameError, UsageError

if TYPE_CHECKING:
    from koopcli.config.settings import Simulate
    from koopcli.stages.base import Task
    from koopcli.stages.pipeline import Artefact, Pipeline, Step


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

    def simulated(self, predictor: Task) -> Simulate:
        """The simulation behind ``predictor``, which remembers it when its trajectories are gone."""
        from koopcli.stages.recipes import remembered_simulation

        known = predictor.find("simulate")
        if known is not None:
            settings: Simulate = known.settings
            return settings
        content = self.pipeline.make(predictor).content
        return remembered_simulation(content.plant, content.dt)

    def run(
        self,
        task: Task,
        *,
        as_json: bool,
        dry_run: bool,
        extra: Callable[[Artefact], None] | None = None,
        reads: Sequence[str] = (),
    ) -> None:
        """Make ``task`` and print its name, or print the plan.

        ``reads``: settings, or beginnings of them, that matter beside those of the stages.
        """
        for name, _ in flat(self.changes):
            if any(f"{name}.".startswith(f"{one}.") for one in reads):
                continue
            if idle := why_idle(name, self.experiment, [task]):
                raise UsageError(f"{name} changes nothing here: {idle}")
        if dry_run:
            show_plan(self.pipeline.plan(task), as_json=as_json)
            return
        self.console.note(f"store: {self.pipeline.store.root}")
        artefact = self.pipeline.make(task)
        if extra is not None:
            extra(artefact)
        if as_json:
            print_json(describe(artefact, self.pipeline.store.path(artefact.record)))
        else:
            print(artefact.record.name)


def begin(
    store: Path | None,
    experiment: str,
    assignments: Sequence[str] | None,
    sections: Sequence[str],
    options: Changes | None = None,
) -> Invocation:
    """What a command works with; its ``options`` win over ``--set``, which wins over the experiment file.

    ``sections``: those whose settings the command uses; ``--set`` of any other is refused.
    """
    from koopcli.stages.pipeline import Pipeline

    changes = parse_set(assignments or [])
    for section, values in (options or {}).items():
        changes.setdefault(section, {}).update({key: v for key, v in values.items() if v is not None})
    changes = {section: values for section, values in changes.items() if values}
    for name, _ in flat(changes):
        if name.partition(".")[0] not in sections:
            raise UsageError(f"--set {name} changes nothing here; this command uses {', '.join(sections)}")
    loaded = load_experiment(experiment, changes)
    console, shelf = open_store(store)
    return Invocation(Pipeline(shelf, console), console, loaded, changes)


def why_idle(name: str, experiment: Experiment, tasks: Sequence[Task]) -> str | None:
    """Why the setting ``name`` has no effect on any of ``tasks``, or None where it has one."""
    section, _, key = name.partition(".")
    behind = [step for task in tasks for step in task.upstream()]
    stages = {step.stage for step in behind}
    by_stage = ("simulate", "fit-edmd", "fit-eigen", "baseline", "evaluate")
    tested = _test_samples(behind)
    trained = _samples(behind) - tested
    of_nothing = {
        **dict.fromkeys(by_stage, section not in stages),
        **dict.fromkeys(("plot", "reproduce"), True),
        "sample": not (trained or tested),
        "test": not tested,
    }
    if tasks and of_nothing.get(section) and not (section in ("sample", "test") and "." in key):
        drawn = tasks[0].stage == "plot"
        return f"the figure '{tasks[0].settings.figure}' draws nothing of it" if drawn else "nothing is made by it"
    if section in ("vehicle", "simulate"):
        plants = {step.settings.plant for step in behind if step.stage == "simulate"}
        by_energy = any(
            key in (*OF_VEHICLE, "name") and hasattr(step.settings, OF_VEHICLE[0])
            for step in behind
            if step.stage == "sample"
        )
        if not plants and not by_energy:
            return "only kinds of sample by kinetic energy depend on the vehicle, through its m and Jzz"
        unused = [plant for plant in plants if any(f"{name}.".startswith(f"{one}.") for one in UNUSED[plant])]
        if plants and len(unused) == len(plants):
            return f"the plant '{unused[0]}' has no use for it"
    if section in ("sample", "test") and "." in key:
        kind = key.partition(".")[0]
        relevant = tested if section == "test" else trained or tested
        if kind not in {one.settings.kind for one in relevant}:
            return f"no {section} of kind '{kind}' is used"
    fits: dict[str, tuple[FitEdmd | FitEigen, str]] = {
        "fit-edmd": (experiment.fit_edmd, "basis"),
        "fit-eigen": (experiment.fit_eigen, "boundary"),
    }
    if section in fits:
        settings, chosen = fits[section]
        if getattr(settings.settled(), key) != getattr(settings, key):
            return f"{section}.{chosen} '{getattr(settings, chosen)}' has no use for it"
    return None


def _samples(behind: Sequence[Task]) -> set[Task]:
    return {step for step in behind if step.stage == "sample"}


def _test_samples(behind: Sequence[Task]) -> set[Task]:
    """The samples that evaluations and figures among ``behind`` test on."""
    tests = [
        task
        for step in behind
        if step.stage in ("evaluate", "plot")
        for role, task in step.inputs
        if role.rpartition("/")[2] == "trajectories"
    ]
    return {sample for test in tests for sample in _samples(list(test.upstream()))}


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
    """One JSON value on stdout; what is not a finite number becomes null."""
    print(json.dumps(_finite(value), indent=1, ensure_ascii=False))


def write_csv(content: Any, file: IO[str]) -> None:
    """The table of an artefact's ``content``."""
    header, rows = content.table()
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(rows)


def show_plan(steps: Sequence[Step], *, as_json: bool) -> None:
    """The table of a dry run, on stdout."""
    from koopcli.store.files import size_text

    seconds, size = sum(step.cost.seconds for step in steps), sum(step.cost.bytes for step in steps)
    if as_json:
        rows = [
            {"name": step.name, "action": step.state, **vars(step.cost), "settings": asdict(step.task.settings)}
            for step in steps
        ]
        print_json({"dry_run": True, "steps": rows, "seconds": round(seconds, 2), "bytes": round(size)})
        return
    table = []
    for step in steps:
        made = step.state == "make"
        cost = (f"{step.cost.seconds:.1f} s", size_text(step.cost.bytes)) if made else ("", "")
        table.append([step.name, step.state, brief(asdict(step.task.settings)), *cost])
    table.append(["total, roughly", "", "", f"{seconds:.1f} s", size_text(size)])
    show_table(["artefact", "would", "settings", "time", "size"], table, left=3)


def brief(settings: dict[str, Any]) -> str:
    """Settings in one short text, nested ones left out."""
    return " ".join(f"{key}={value}" for key, value in settings.items() if not isinstance(value, (dict, list, tuple)))


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(v) for key, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(v) for v in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
