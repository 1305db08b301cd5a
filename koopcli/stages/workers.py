"""Where work runs: in this process or in several, behind one ``concurrent.futures.Executor``.

Jobs and their results are small: what a job works on, and what it makes, lies in the store.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing.connection import wait as wait_for
from types import TracebackType
from typing import Any, Self, TypeVar

from koopcli.errors import InvalidValueError

MOST = 256
Job = TypeVar("Job")
Result = TypeVar("Result")


class Workers:
    """``count`` processes that start afresh when the first job needs them; one means this process.

    Leaving its ``with`` by an exception stops them at once: what they have committed stays.
    """

    def __init__(self, count: int = 1) -> None:
        if not 1 <= count <= MOST:
            raise InvalidValueError(f"'--workers' must be from 1 to {MOST}, got {count}")
        self.count = count
        self._executor: Executor | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        executor, self._executor = self._executor, None
        if executor is None:
            return
        executor.shutdown(wait=kind is None, cancel_futures=True)
        if kind is not None and self.count > 1:
            for process in multiprocessing.active_children():
                process.terminate()

    def submit(self, function: Callable[[Job], Result], job: Job) -> Future[Result]:
        """Begin a job; in this process it is done when this returns. ``function`` stands in a module by its name."""
        executor = self._executor = self._executor or self._started()
        # A worker is born with SIGINT blocked: Ctrl-C in a terminal is for this process, which stops the others.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            return executor.submit(function, job)
        except BrokenProcessPool as error:
            raise _died() from error
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)

    def each(self, function: Callable[[Job], Result], jobs: Sequence[Job]) -> Iterator[tuple[Job, Result]]:
        """The jobs with their results, as they are done; no more are begun than keep every worker busy."""
        running: dict[Future[Result], Job] = {}
        waiting = list(reversed(jobs))
        while waiting or running:
            while waiting and len(running) < self.width:
                job = waiting.pop()
                running[self.submit(function, job)] = job
            for future in done(running):
                yield running.pop(future), result(future)

    @property
    def width(self) -> int:
        """How many jobs to begin at a time."""
        return 1 if self.count == 1 else 2 * self.count

    def _started(self) -> Executor:
        if self.count == 1:
            return _Here()
        context = multiprocessing.get_context("spawn")
        return ProcessPoolExecutor(self.count, context, initializer=_end_with_parent)


def done(running: dict[Future[Result], Any]) -> set[Future[Result]]:
    """Those of ``running`` that are done, once there are any."""
    return wait(running, return_when=FIRST_COMPLETED).done


def result(future: Future[Result]) -> Result:
    """The result of a job that is done. Raises what it raised, or ``InvalidValueError`` where its process died."""
    try:
        return future.result()
    except BrokenProcessPool as error:
        raise _died() from error


class WorkerDiedError(InvalidValueError):
    """A worker was ended from outside: what it did would end the next one too."""


def _died() -> WorkerDiedError:
    return WorkerDiedError(
        "a worker process died, most likely for want of memory: choose fewer --workers; what is done stays done"
    )


class _Here(Executor):
    """Runs a job when it is submitted; what it raises is raised there, an interrupt too."""

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """The future of a job that is done."""
        future: Future[Any] = Future()
        future.set_result(fn(*args, **kwargs))
        return future


def _end_with_parent() -> None:
    """End this worker when the process that began it is gone, by whatever means."""
    parent = multiprocessing.parent_process()
    assert parent is not None, "this runs in a worker"

    def watch() -> None:
        wait_for([parent.sentinel])
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
