"""Many tasks at once: those whose inputs are there are made by workers, each a whole artefact in a process of its own.

What comes after finds everything in the store. A task that cannot be made is left to it, to be met in its place.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from koopcli.errors import KoopError, LockTimeoutError, StorageError
from koopcli.progress import Progress, silent
from koopcli.stages.base import Task
from koopcli.stages.pipeline import Pipeline
from koopcli.stages.workers import OtherCodeError, WorkerDiedError, check_code
from koopcli.store import Store
from koopcli.store.code import code_digest

FATAL = (StorageError, LockTimeoutError, WorkerDiedError, OtherCodeError)  # the next task would fare no better


@dataclass(frozen=True)
class Making:
    """An artefact to make, small enough to be sent to another process; ``code``: the digest of the code that asks."""

    root: Path
    task: Task
    code: str


@dataclass(frozen=True)
class Messages:
    """What was ``said`` of each artefact on the way, by name, and what was ``warned`` of."""

    said: dict[str, str]
    warned: list[str]


def make(making: Making) -> Messages:
    """Make an artefact whose inputs are in the store. Raises ``OtherCodeError`` where other code has asked for it."""
    check_code(making.code)
    heard = _Heard()
    pipeline = Pipeline(Store(making.root, heard.warn), heard)
    pipeline.make(making.task)
    return Messages(pipeline.said, heard.warned)


def make_ahead(pipeline: Pipeline, tasks: Iterable[Task]) -> dict[Task, KoopError]:
    """Make what is missing of ``tasks`` and behind them, if there are workers to share it; say how much was there.

    Returns those that could not be made, and why.
    """
    wanted = list(dict.fromkeys(step for task in tasks for step in task.upstream()))
    missing = [task for task in wanted if pipeline.found(task) is None]
    if 0 < len(missing) < len(wanted):
        pipeline.reporter.note(f"{len(wanted) - len(missing)} of {len(wanted)} artefacts were already there")
    failed: dict[Task, KoopError] = {}
    if pipeline.workers.alone or not missing:
        return failed
    pipeline.workers.begin(pipeline.store.folder())
    with pipeline.reporter.progress("making") as progress:
        for count, messages in enumerate(_each(pipeline, missing, failed), 1):
            progress(count, len(missing))
            for text in messages.warned:
                pipeline.reporter.warn(text)
            for name, what in messages.said.items():
                pipeline.announce(name, what)
    return failed


def _each(pipeline: Pipeline, missing: list[Task], failed: dict[Task, KoopError]) -> Iterator[Messages]:
    """Make ``missing``, each as soon as its inputs are there; what depends on one that ``failed`` is not begun."""
    lacked = set(missing)
    lacking = {task: {step for _, step in task.inputs if step in lacked} for task in missing}
    waiting: dict[Task, list[Task]] = {}
    for task, inputs in lacking.items():
        for step in inputs:
            waiting.setdefault(step, []).append(task)
    ready = deque(task for task, inputs in lacking.items() if not inputs)
    running: dict[Future[Messages], Task] = {}
    root = pipeline.store.root.absolute()
    while ready or running:
        while ready and len(running) < pipeline.workers.width:
            task = ready.popleft()
            running[pipeline.workers.submit(make, Making(root, task, code_digest()))] = task
        for future in pipeline.workers.done(running):
            task = running.pop(future)
            try:
                messages = pipeline.workers.result(future)
            except FATAL:
                raise
            except KoopError as error:
                failed[task] = error
                continue
            for dependent in waiting.get(task, ()):
                lacking[dependent].discard(task)
                if not lacking[dependent]:
                    ready.appendleft(dependent)  # what is begun is finished first
            yield messages


@dataclass(frozen=True)
class _Heard:
    """A reporter that keeps its warnings."""

    warned: list[str] = field(default_factory=list)

    def note(self, text: str) -> None:
        """Nothing: what is said of artefacts is kept by their names."""

    def warn(self, text: str) -> None:
        """Keep the warning."""
        self.warned.append(text)

    @contextmanager
    def progress(self, label: str) -> Iterator[Progress]:
        """No display."""
        yield silent
