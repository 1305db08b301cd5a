"""What runs jobs, as a ``concurrent.futures.Executor``: this process, some of this machine, or a Dask cluster."""

from __future__ import annotations

import logging
import math
import os
import socket
import threading
import time
from collections.abc import Callable
from concurrent.futures import CancelledError, Executor, Future
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from koopcli import __version__
from koopcli.errors import InvalidValueError
from koopcli.parsing import parse_json
from koopcli.store.code import SHORT, code_digest

MOST = 256
ANSWERS_WITHIN = 10  # seconds
COUNTED_EVERY = 5  # seconds


class Engine(Protocol):
    """Starts and stops an executor."""

    @property
    def alone(self) -> bool:
        """Whether jobs run in this process, one after another."""

    @property
    def width(self) -> int:
        """How many jobs to begin at a time, so that every worker is busy."""

    def start(self, store: Path) -> Executor:
        """The executor for jobs on the ``store``."""

    def stop(self, executor: Executor, *, at_once: bool) -> None:
        """Stop it, ``at_once`` if what is begun is no longer wanted."""

    def stalled(self) -> str | None:
        """Why nothing may be done by now, and what to do, where that is so."""

    def died(self, error: BaseException) -> str | None:
        """What happened to a worker or to the engine where ``error`` says that one is gone, and what to do."""


@dataclass(frozen=True)
class Here:
    """This process."""

    alone = True
    width = 1

    def start(self, store: Path) -> Executor:
        """Runs a job when it is submitted."""
        return _AtOnce()

    def stop(self, executor: Executor, *, at_once: bool) -> None:
        """Nothing is running."""

    def stalled(self) -> None:
        """A job is done when it is begun."""

    def died(self, error: BaseException) -> None:
        """Then nobody would ask."""


class _AtOnce(Executor):
    """Runs a job when it is submitted; what it raises is raised there, an interrupt too."""

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """The future of a job that is done."""
        future: Future[Any] = Future()
        future.set_result(fn(*args, **kwargs))
        return future


@dataclass(frozen=True)
class Processes:
    """``count`` processes of this machine, which start afresh when the first job needs them."""

    count: int

    alone = False

    def __post_init__(self) -> None:
        if not 1 <= self.count <= MOST:
            raise InvalidValueError(f"'--workers' must be from 1 to {MOST}, got {self.count}")

    @property
    def width(self) -> int:
        """One more for each that is at work."""
        return 2 * self.count

    def start(self, store: Path) -> Executor:
        """A pool of processes."""
        import multiprocessing  # noqa: PLC0415  (most commands go without)
        from concurrent.futures import ProcessPoolExecutor  # noqa: PLC0415

        context = multiprocessing.get_context("spawn")
        return ProcessPoolExecutor(self.count, context, initializer=_end_with_parent)

    def stop(self, executor: Executor, *, at_once: bool) -> None:
        """End the processes; what they have committed stays."""
        import multiprocessing  # noqa: PLC0415

        executor.shutdown(wait=not at_once, cancel_futures=True)
        if at_once:
            for process in multiprocessing.active_children():
                process.terminate()

    def stalled(self) -> None:
        """The pool says what happened."""

    def died(self, error: BaseException) -> str | None:
        """A process that was ended from outside breaks the pool."""
        from concurrent.futures.process import BrokenProcessPool  # noqa: PLC0415

        if isinstance(error, BrokenProcessPool):
            return "a worker process died, most likely for want of memory: choose fewer --workers"
        return None


@dataclass
class Cluster:
    """A running Dask cluster by the ``address`` of its scheduler, or by the scheduler file (.json) that it wrote.

    Its workers see the same store as this process, and have the same code of koopcli. One that is killed costs what it
    was doing: the scheduler gives that to another.
    """

    address: str
    _client: Any = field(default=None, repr=False)
    _threads: int = 0
    _counted: float = -math.inf

    alone = False

    @property
    def width(self) -> int:
        """Two jobs for each thread of the workers."""
        return max(2, 2 * self._count())

    def start(self, store: Path) -> Executor:
        """The cluster's own executor. Raises ``InvalidValueError`` where it is not there or of no use here."""
        try:
            from distributed import Client  # noqa: PLC0415  (an extra)
        except ModuleNotFoundError as error:
            raise InvalidValueError(
                "--cluster needs Dask distributed, which is not installed: pip install 'koopcli[dask]'"
            ) from error
        for name in [*logging.root.manager.loggerDict, "asyncio", "tornado.application"]:
            if name.startswith(("distributed", "asyncio", "tornado")):
                logging.getLogger(name).setLevel(logging.CRITICAL + 1)  # what matters is said in one line
        client: Any = Client  # without types
        try:
            address = self._reached()
            self._client = client(address, timeout=ANSWERS_WITHIN, set_as_default=False)
        except (OSError, ValueError, TypeError, KeyError) as error:
            raise InvalidValueError(
                f"--cluster {self.address}: no Dask scheduler answers there: begin one with 'dask scheduler', workers "
                "with 'dask worker', and give the address that it prints"
            ) from error
        try:
            self._look(store)
        except BaseException:
            self._client.close()
            raise
        executor: Executor = self._client.get_executor(pure=False)
        return executor

    def stop(self, executor: Executor, *, at_once: bool) -> None:
        """Leave the cluster. What is running there ends as it would; what waits is called off."""
        client, self._client = self._client, None
        with suppress(Exception):  # of a scheduler that is gone nothing is left to stop
            executor.shutdown(wait=not at_once)
        with suppress(Exception):
            client.close(timeout=ANSWERS_WITHIN)

    def stalled(self) -> str | None:
        """Where the last worker has left; others may come."""
        if self._count() > 0:
            return None
        return f"the Dask cluster at {self.address} has no workers left: begin some, the work goes on with them"

    def died(self, error: BaseException) -> str | None:
        """Jobs whose workers died again and again, and those of a scheduler that is gone."""
        if type(error).__name__ == "KilledWorker":
            return f"the workers of {self.address} died over one job, most likely for want of memory: give them more"
        if isinstance(error, CancelledError) or type(error).__name__ in ("CommClosedError", "FutureCancelledError"):
            return f"the Dask cluster at {self.address} is gone: begin it again"
        return None

    def _count(self) -> int:
        """How many threads the workers have, who may come and go."""
        if self._client is not None and time.monotonic() > self._counted + COUNTED_EVERY:
            self._counted = time.monotonic()
            with suppress(OSError, RuntimeError):  # of a scheduler that is gone the jobs tell
                self._threads = sum(self._client.nthreads().values())
        return self._threads

    def _reached(self) -> str:
        """The address, itself or in the scheduler file, where something listens: a client that finds nothing is slow
        to give up and does so on stderr.
        """
        from distributed.comm.addressing import get_address_host_port  # noqa: PLC0415

        address = self.address
        if address.endswith(".json"):
            address = str(parse_json(Path(address).read_text(encoding="utf-8"))["address"])
        socket.create_connection(get_address_host_port(address, strict=True), ANSWERS_WITHIN).close()
        return address

    def _look(self, store: Path) -> None:
        """Refuse workers of other code, and those that do not see the store."""
        try:
            codes = self._client.run(_seen_from_here, str(store))
        except Exception as error:  # whatever a worker without koopcli makes of it
            raise InvalidValueError(
                f"--cluster {self.address}: its workers cannot load koopcli {__version__}: install it where they run"
            ) from error
        if not codes:
            raise InvalidValueError(f"--cluster {self.address} has no workers: begin some with 'dask worker'")
        for worker, (code, shared) in codes.items():
            if code != _code():
                raise InvalidValueError(
                    f"--cluster {self.address}: the worker {worker} has koopcli {code}, this is {_code()}: install one "
                    "koopcli everywhere and begin the workers again"
                )
            if not shared:
                raise InvalidValueError(
                    f"--cluster {self.address}: the worker {worker} does not see the store {store}: choose a --store "
                    "on a file system that all of them share"
                )


def _seen_from_here(store: str) -> tuple[str, bool]:
    """On a worker: its koopcli, and whether it sees the folder ``store``."""
    return _code(), os.path.isdir(store)


def _code() -> str:
    """The koopcli of this process in words: its version, which edits leave as it is, and its code."""
    return f"{__version__} with code {code_digest()[:SHORT]}"


def _end_with_parent() -> None:
    """End this worker when the process that began it is gone, by whatever means."""
    import multiprocessing  # noqa: PLC0415
    from multiprocessing.connection import wait  # noqa: PLC0415

    parent = multiprocessing.parent_process()
    assert parent is not None, "this runs in a worker"

    def watch() -> None:
        wait([parent.sentinel])
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
