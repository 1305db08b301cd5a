"""Make a task or find it made: keys from recipes, hits without locks, misses under one, damage rebuilt."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from koopcli.errors import DamagedArtefactError, StorageError, UnknownNameError
from koopcli.stages.base import Context, Cost, Reporter, Stage, Task
from koopcli.stages.chunks import Chunk, ChunkedWork
from koopcli.stages.labels import labels
from koopcli.stages.recorded import content_of, recipe_of, settings_of
from koopcli.stages.registry import STAGES
from koopcli.stages.vehicle import doubts
from koopcli.stages.workers import Workers
from koopcli.store import Record, Store
from koopcli.store.code import code_digest
from koopcli.store.identity import key_of, plain
from koopcli.store.names import SHORT
from koopcli.store.provenance import provenance


@dataclass(frozen=True)
class Artefact:
    """A made or found artefact: its ``record`` in the store and its content, verified."""

    record: Record
    content: Any
    cached: bool
    seconds: float

    @property
    def stage(self) -> Stage:
        """The stage that made it."""
        return STAGES[self.record.stage]

    @property
    def figures(self) -> dict[str, Any]:
        """The stage's numbers of the content."""
        return self.stage.figures(self.content)


@dataclass(frozen=True)
class Step:
    """One line of a dry run: ``state`` is "reuse" or "make"."""

    task: Task
    state: str
    name: str
    cost: Cost


class Pipeline:
    """Runs tasks against a store, telling the ``reporter`` what was made and what was reused."""

    def __init__(self, store: Store, reporter: Reporter, workers: Workers | None = None) -> None:
        self.store = store
        self.reporter = reporter
        self.workers = workers or Workers()
        self.workers.warn = reporter.warn
        self._records: dict[Task, Record] = {}
        self.said: dict[str, str] = {}
        """What was said of each artefact, by name."""
        self._doubted: set[str] = set()

    def make(self, task: Task) -> Artefact:
        """The artefact of ``task``, from the store where possible; what is missing upstream is made first."""
        self.check(task)
        start = time.perf_counter()
        record, content, cached = self._obtain(task)
        return Artefact(record, content, cached, time.perf_counter() - start)

    def plan(self, task: Task) -> list[Step]:
        """What :meth:`make` would reuse and make, inputs first, without making anything."""
        steps: dict[Task, Step] = {}

        def visit(step: Task) -> None:
            record = self.found(step)
            if record is not None:
                steps[step] = Step(step, "reuse", record.name, Cost(0, 0))
                return
            for _, upstream in step.inputs:
                visit(upstream)
            steps[step] = Step(step, "make", step.name, cost(step))

        self.check(task)
        visit(task)
        return list(steps.values())

    def found(self, task: Task) -> Record | None:
        """The record of ``task`` if it and its object are in the store, neither of which is read."""
        record = self._known(task)
        return record if record is not None and self.store.has_object(record) else None

    def there(self, task: Task) -> Artefact | None:
        """The artefact of ``task`` if the store has it whole; nothing is made and nothing said."""
        record = self.found(task)
        try:
            return None if record is None else Artefact(record, content_of(record, self.store), True, 0.0)
        except DamagedArtefactError:
            return None

    def named(self, text: str) -> Task:
        """The task of the artefact named ``text``, with its inputs as far as their records are known."""
        return self._task(self.store.find(text))

    def with_inputs(self, records: Sequence[Record]) -> list[Record]:
        """``records`` and all that they were made from, as far as it is in the store."""
        behind: dict[str, Record] = {}
        waiting = list(records)
        while waiting:
            record = waiting.pop()
            if record.key not in behind:
                behind[record.key] = record
                inputs = (self.store.record(*name.split("/")) for name in record.lineage.values())
                waiting += [record for record in inputs if record is not None]
        return list(behind.values())

    def check(self, task: Task) -> None:
        """Refuse a task that cannot work, and warn of an odd vehicle once, without making anything."""
        for step in task.upstream():
            if step.key is None:
                STAGES[step.stage].check(step)
            for text in doubts(step):
                if text not in self._doubted:
                    self._doubted.add(text)
                    self.reporter.warn(text)

    def _task(self, record: Record, below: tuple[str, ...] = ()) -> Task:
        if record.key in below:
            raise DamagedArtefactError(f"{record.name} is named among what it was made from: run its command afresh")
        settings = settings_of(record)
        inputs = []
        for role, name in record.lineage.items():
            stage, _, key = name.partition("/")
            upstream = self.store.record(stage, key)
            if upstream is not None:
                inputs.append((role, self._task(upstream, (*below, record.key))))
        task = Task(record.stage, settings, tuple(inputs), record.key)
        self._records[task] = record
        return task

    def _known(self, task: Task) -> Record | None:
        """The record of ``task`` if it was ever made, found without reading or making anything."""
        if task in self._records:
            return self._records[task]
        if task.key is not None:
            return self.store.record(task.stage, task.key)
        inputs = {}
        for role, upstream in task.inputs:
            record = self._known(upstream)
            if record is None:
                return None
            inputs[role] = record
        own = self.store.record(task.stage, key_of(recipe_of(task, inputs)))
        if own is not None:
            self._records[task] = own
        return own

    def _obtain(self, task: Task) -> tuple[Record, Any, bool]:
        """Record, content, and whether it was there already."""
        record = self._known(task)
        content = self._read(task, record)
        if record is not None and content is not None:
            return record, content, True
        if task.key is not None:
            self._rebuildable(task, record)
        return self._build(task)

    def _read(self, task: Task, record: Record | None) -> Any:
        """The verified content behind ``record``, or None when it is not there or damaged."""
        if record is None or not self.store.has_object(record):
            return None
        try:
            content = content_of(record, self.store)
        except DamagedArtefactError as error:
            self.reporter.warn(f"{error}; making it again")
            return None
        self._records[task] = record
        self.store.sync(record)
        self.announce(record.name, "reused")
        return content

    def _build(self, task: Task) -> tuple[Record, Any, bool]:
        """Make ``task``, again where a large input turned out damaged while it was read."""
        try:
            return self._build_once(task)
        except DamagedArtefactError as error:
            inputs = [self._known(upstream) for _, upstream in task.inputs]
            if all(record is None or self.store.has_object(record) for record in inputs):
                raise
            self.reporter.warn(f"{error}; making it again")
            return self._build_once(task)

    def _build_once(self, task: Task) -> tuple[Record, Any, bool]:
        """Make ``task`` under its lock, unless another process has just done so."""
        stage = STAGES[task.stage]
        self.store.require(cost(task).bytes)  # before anything is made for it
        inputs = {}
        for role, upstream in task.inputs:
            record, content, _ = self._obtain(upstream)
            inputs[role] = (record, stage.keep(content))
        recipe = recipe_of(task, {role: record for role, (record, _) in inputs.items()})
        key = key_of(recipe)
        if task.key not in (None, key):
            raise DamagedArtefactError(
                f"{task.name} cannot be made again: what it was made from comes out "
                "different here in its last bits; run its command afresh"
            )
        with self.store.lock(key, f"{task.stage}/{key[:SHORT]}"):
            existing = self.store.record(task.stage, key)
            content = self._read(task, existing)
            if existing is not None and content is not None:
                return existing, content, True
            start = time.perf_counter()
            try:
                made = self._run(task, recipe, inputs)
            except (FileNotFoundError, StorageError):
                # Where no lock keeps others away, one may have finished it and cleared the chunks that were being read.
                existing = self.store.record(task.stage, key)
                content = self._read(task, existing)
                if existing is None or content is None:
                    raise
                return existing, content, True
            seconds = time.perf_counter() - start
            if existing is not None and existing.data != made.data:
                self.reporter.warn(
                    f"{made.name} came out different in its last bits; what follows from it is made anew"
                )
            self.store.parts(key).clear()
        # Go on with what a later process would read: the memory layout of an array moves the last bits of products.
        content = content_of(made, self.store)
        self._records[task] = made
        self.announce(made.name, f"made in {seconds:.1f} s: {stage.describe(stage.figures(content), task.settings)}")
        return made, content, False

    def _run(self, task: Task, recipe: Mapping[str, Any], inputs: Mapping[str, tuple[Record, Any]]) -> Record:
        """Compute and commit ``task``; what was computed is let go of, before as much is read again."""
        start = time.perf_counter()
        stage, key = STAGES[task.stage], key_of(recipe)
        contents = {role: content for role, (_, content) in inputs.items()}
        lineage = {role: f"{record.stage}/{record.key}" for role, (record, _) in inputs.items()}
        with self.reporter.progress(stage.name) as progress:
            inputs_by_name = tuple(lineage.items())
            whole = Chunk(
                self.store.root, task.stage, task.settings, key, inputs_by_name, code=code_digest(), at_hand=contents
            )
            chunks = ChunkedWork(self.store, whole, self.workers, progress, self.reporter.note, cost(task).bytes)
            packed = stage.run(task.settings, contents, Context(progress, self.reporter.warn, chunks)).pack()
        told, origin = labels(task, packed), provenance(time.perf_counter() - start)
        return self.store.commit(recipe, lineage, packed, origin, told, plain(task.settings))

    def _rebuildable(self, task: Task, record: Record | None) -> None:
        """Refuse to replace a named artefact by something that today's code would not give the same key."""
        inputs = {role: self._known(upstream) for role, upstream in task.inputs}
        present = {role: upstream for role, upstream in inputs.items() if upstream is not None}
        complete = record is not None and set(present) == set(record.lineage)
        if not complete or key_of(recipe_of(task, present)) != task.key:
            raise DamagedArtefactError(
                f"{task.name} is damaged and cannot be made again, because its inputs are "
                "gone or another version made it: run its command afresh"
            )

    def announce(self, name: str, what: str) -> None:
        """Say how an artefact came here, once."""
        if name not in self.said:
            self.said[name] = what
            self.reporter.note(f"{name:<24} {what}")


def cost(task: Task) -> Cost:
    """What making ``task`` will cost, as far as what it is made from is known."""
    try:
        return STAGES[task.stage].estimate(task)
    except UnknownNameError:  # something behind a named artefact is gone, which only an estimate needs
        return Cost(0, 0)
