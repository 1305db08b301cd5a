"""Many tasks at once: those whose inputs are there are made by workers, each a whole artefact in a process of its own.

What comes after finds everything in the store. A task that cannot be made is left to it, to be met in its place.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from koopcli.errors import KoopError, StorageError
from koopcli.progress import Progress, silent
from koopcli.stages.base import Task
from koopcli.stages.pipeline import Pipeline
from koopcli.stages.workers import WorkerDiedError, done, result
from koopcli.store import Store


@dataclass(frozen=True)
class Making:
    """An artefact to make, small enough to be sent to another process."""

    root: Path
    task: Task


@dataclass(frozen=True)
class Made:
    """What was ``said`` of each artefact on the way, by name, and what was ``warned`` of."""

    said: dict[str, str]
    warned: list[str]


def make(making: Making) -> Made:
    """Make an artefact whose inputs are in the store."""
    heard = _Heard()
    pipeline = Pipeline(Store(making.root, heard.warn), heard)
    pipeline.make(making.task)
    return Made(pipeline.said, heard.warned)


def make_ahead(pipeline: Pipeline, tasks: Iterable[Task]) -> None:
    """Make what is missing of ``tasks`` and behind them, if there are workers to share it; say how much was there."""
    wanted = list(dict.fromkeys(step for task in tasks for step in task.upstream()))
    missing = [task for task in wanted if pipeline.found(task) is None]
    if 0 < len(missing) < len(wanted):
        pipeline.reporter.note(f"{len(wanted) - len(missing)} of {len(wanted)} artefacts were already there")
    if pipeline.workers.count == 1:
        return
    with pipeline.reporter.progress("making") as progress:
        for count, made in enumerate(_each(pipeline, missing), 1):
            progress(count, len(missing))
            for text in made.warned:
                pipeline.reporter.warn(text)
            for name, what in made.said.items():
                pipeline.announce(name, what)


def _each(pipeline: Pipeline, missing: list[Task]) -> Iterator[Made]:
    """Make ``missing``, each as soon as its inputs are there; what depends on one that fails is not begun."""
    lacking = {task: {one for _, one in task.inputs} & set(missing) for task in missing}
    running: dict[Future[Made], Task] = {}
    while True:
        ready = [task for task, inputs in lacking.items() if not inputs]
        for task in ready[: pipeline.workers.width - len(running)]:
            running[pipeline.workers.submit(make, Making(pipeline.store.root, task))] = task
            del lacking[task]
        if not running:
            return
        for future in done(running):
            task = running.pop(future)
            try:
                made = result(future)
            except (StorageError, WorkerDiedError):  # the next one would fare no better
                raise
            except KoopError:
                continue
            for inputs in lacking.values():
                inputs.discard(task)
            yield made


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
