"""What a stage is, and what a task is: a stage with its settings and the tasks that make its inputs."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any, Protocol

from koopcli.errors import InvalidValueError, UnknownNameError
from koopcli.progress import Progress
from koopcli.records import Meta, Packed
from koopcli.store.files import size_text
from koopcli.store.names import SHORT

Inputs = Mapping[str, Any]  # role -> record
MEMORY_SHARE = 0.4  # arrays are held about twice while they are made and stored


def refuse_beyond_memory(what: str, needed: float, remedy: str) -> None:
    """Raise ``InvalidValueError`` for arrays of ``needed`` bytes that this machine's memory cannot hold."""
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    if needed > MEMORY_SHARE * memory:
        raise InvalidValueError(
            f"{what} would need {size_text(needed)} of this machine's {size_text(memory)}: lower {remedy}"
        )


class Reporter(Protocol):
    """Where a stage speaks to the user; the command line implements it, a test may too."""

    def note(self, text: str) -> None:
        """Say something worth knowing."""

    def warn(self, text: str) -> None:
        """Say something that may be wrong."""

    def progress(self, label: str) -> AbstractContextManager[Progress]:
        """A progress display for the time of a ``with``."""


class Chunks(Protocol):
    """Work in chunks, each committed as it is done; those already there are not computed again."""

    def __call__(self, count: int, size: int, given: Packed | None = None, each: float = 0.0) -> list[Packed]:
        """The results of the stage's ``chunk`` on consecutive slices of ``range(count)`` of length ``size``.

        A stage may ask several times, each time with something else that is ``given``: its chunks find it among their
        inputs as "given". ``each``: about how many bytes one of them stores, where it is no part of the whole.
        """


@dataclass(frozen=True)
class Context:
    """What a running stage may use besides its settings and inputs."""

    progress: Progress
    warn: Callable[[str], None]
    chunks: Chunks


@dataclass(frozen=True)
class Cost:
    """A rough estimate: seconds on one core and bytes stored."""

    seconds: float
    bytes: float


@dataclass(frozen=True)
class Task:
    """A stage with its settings and its inputs by role. ``key`` fixes an artefact that was named instead."""

    stage: str
    settings: Any
    inputs: tuple[tuple[str, Task], ...] = ()
    key: str | None = None

    @property
    def name(self) -> str:
        """The name of the artefact that was named; a task by its recipe has none yet."""
        return f"{self.stage}/{self.key[:SHORT]}" if self.key else f"{self.stage}/…"

    def find(self, stage: str) -> Task | None:
        """The nearest task of ``stage`` upstream, this one included, if it is known."""
        return next((task for task in self.upstream() if task.stage == stage), None)

    def input(self, role: str) -> Task:
        """The input ``role``. Raises ``UnknownNameError`` when its record is gone."""
        task = dict(self.inputs).get(role)
        if task is None:
            raise UnknownNameError(f"the {role} behind {self.name} is no longer in the store: make it afresh")
        return task

    def ancestor(self, stage: str) -> Task:
        """What :meth:`find` finds. Raises ``UnknownNameError`` when its record is gone."""
        task = self.find(stage)
        if task is None:
            raise UnknownNameError(f"the {stage} stage behind {self.name} is no longer in the store: make it afresh")
        return task

    def upstream(self) -> Iterator[Task]:
        """This task and all before it, nearest first."""
        yield self
        for _, task in self.inputs:
            yield from task.upstream()


@dataclass(frozen=True)
class Outlook:
    """What a fit will be, before it is made: its size, its longest horizon, its label, and what its steps cost."""

    functions: int
    """Dimension of the lifted state."""
    horizon: int | None
    """The most steps of a prediction, None for any number."""
    name: str
    """What it is called in tables and figures."""
    data: str = ""
    """What its training data are called."""
    order: int | None = None
    """The order of its basis, if that has one."""
    a_step: float = 1.5e-4
    """Seconds for one step from states lifted afresh, however few they are."""
    a_state: float = 0.0
    """Seconds for each state that is moved on by one step, beside what its lifted states cost."""
    a_lift: float = 0.0
    """Seconds for each state that is lifted."""


@dataclass(frozen=True)
class Stage:
    """One stage. Changing what ``run`` computes means raising ``version``: it is part of every key."""

    name: str
    version: int
    settings: Callable[[Mapping[str, Any]], Any]
    """Settings from the JSON of a record."""
    run: Callable[[Any, Inputs, Context], Any]
    """(settings, inputs, context) -> record, which has ``pack()``."""
    unpack: Callable[[Packed], Any]
    """The record from storage."""
    figures: Callable[[Any], Meta]
    """The record's numbers for ``--json`` and the lines on stderr."""
    describe: Callable[[Meta, Any], str]
    """Those numbers, of what was made with its settings, in a few words."""
    check: Callable[[Task], None]
    """Refuse, before anything upstream is made, a task that cannot work."""
    estimate: Callable[[Task], Cost]
    """What making the task will cost, its inputs aside."""
    chunk: Callable[[Any, Inputs, slice, Progress], Packed] | None = None
    """Of a stage that asks for chunks: (settings, inputs, rows, progress) -> what one of them holds."""
    keep: Callable[[Any], Any] = lambda content: content
    """What of an input's content ``run`` works with: the rest is let go of as soon as it is read."""
    predicts: Callable[[Task], Outlook] | None = None
    """Of a stage that makes predictors: what the predictor of a task will be."""
