"""Where work runs: in this process or in others, behind one ``concurrent.futures.Executor``.

Jobs and their results are small: what a job works on, and what it makes, lies in the store.
"""

from __future__ import annotations

import signal
from collections.abc import Callable, Collection, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from pathlib import Path
from types import TracebackType
from typing import Self, TypeVar

from koopcli.errors import InvalidValueError, UsageError
from koopcli.stages.engines import Cluster, Engine, Here, Processes
from koopcli.store.code import SHORT, code_digest

PATIENCE = 5.0  # seconds
Job = TypeVar("Job")
Result = TypeVar("Result")


class Workers:
    """``count`` processes, one meaning this one, or those of the Dask ``cluster``; they start with the first job.

    Leaving its ``with`` by an exception stops them at once: what they have committed stays.
    """

    def __init__(self, count: int = 1, cluster: str | None = None) -> None:
        if cluster is not None and count != 1:
            raise UsageError("--workers are of this machine, --cluster brings its own: leave out one of them")
        processes = Processes(count)
        self._engine: Engine = Cluster(cluster) if cluster is not None else Here() if count == 1 else processes
        self._executor: Executor | None = None
        self.warn: Callable[[str], None] = lambda text: None
        """Receives what a user should know while jobs are waited for."""

    @property
    def alone(self) -> bool:
        """Whether jobs run in this process."""
        return self._engine.alone

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        executor, self._executor = self._executor, None
        if executor is not None:
            self._engine.stop(executor, at_once=kind is not None)

    def begin(self, store: Path) -> None:
        """Start what runs jobs on the ``store``, unless it is running."""
        if self._executor is None:
            self._executor = self._engine.start(store)

    def submit(self, function: Callable[[Job], Result], job: Job) -> Future[Result]:
        """Begin a job; in this process it is done when this returns. ``function`` stands in a module by its name."""
        assert self._executor is not None, "begun before"
        # A worker is born with SIGINT blocked: Ctrl-C in a terminal is for this process, which stops the others.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            return self._executor.submit(function, job)
        except Exception as error:
            died = self._died(error)
            if died is None:
                raise
            raise died from error
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)

    def result(self, future: Future[Result]) -> Result:
        """The result of a job that is done. Raises what it raised, or ``WorkerDiedError`` where its worker died."""
        try:
            return future.result()
        except BaseException as error:
            died = self._died(error)
            if died is None:
                raise
            raise died from error

    def each(self, function: Callable[[Job], Result], jobs: Sequence[Job], store: Path) -> Iterator[tuple[Job, Result]]:
        """The jobs on a ``store`` with their results, as they are done; no more are begun than keep workers busy."""
        running: dict[Future[Result], Job] = {}
        waiting = list(reversed(jobs))
        if waiting:
            self.begin(store)
        while waiting or running:
            while waiting and len(running) < self.width:
                job = waiting.pop()
                running[self.submit(function, job)] = job
            for future in self.done(running):
                yield running.pop(future), self.result(future)

    def done(self, running: Collection[Future[Result]]) -> set[Future[Result]]:
        """Those of ``running`` that are done, once there are any; says so where nobody is left to do them."""
        while True:
            finished = wait(running, PATIENCE, FIRST_COMPLETED).done
            if finished:
                return finished
            stalled = self._engine.stalled()
            if stalled is not None:
                self.warn(stalled)

    @property
    def width(self) -> int:
        """How many jobs to begin at a time."""
        return self._engine.width

    def _died(self, error: BaseException) -> WorkerDiedError | None:
        text = self._engine.died(error)
        return None if text is None else WorkerDiedError(f"{text}; what is done stays done")


class WorkerDiedError(InvalidValueError):
    """A worker was ended from outside: what it did would end the next one too."""


class OtherCodeError(InvalidValueError):
    """A worker has other code than the command, which would be mixed into what it makes."""


def check_code(code: str) -> None:
    """Refuse a job that other ``code`` has sent: a process may have been running since before an edit."""
    if code != code_digest():
        raise OtherCodeError(
            f"a worker has other code of koopcli ({code_digest()[:SHORT]}) than this command ({code[:SHORT]}): install "
            "one koopcli everywhere, begin the workers again and run the same command again"
        )
