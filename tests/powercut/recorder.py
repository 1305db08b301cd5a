"""Record what processes do to the files under a folder: the calls of ``os`` that change it or make it last.

``python -m tests.powercut.recorder COMMAND…`` records a koop command and its workers into $POWERCUT_LOG.
"""

from __future__ import annotations

import fcntl
import io
import os
import pickle
import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, Protocol, TextIO
from unittest.mock import patch

Event = tuple[Any, ...]
"""("mkdir" | "create" | "remove" | "sync", path), ("move", from, to), ("write", path, place, bytes),
("extend", path, size), ("holds", path, bytes): what HDF5 has written, and ("say", text).
"""
LOG, FOLDER = "POWERCUT_LOG", "POWERCUT_FOLDER"
LARGE = "POWERCUT_LARGE"  # set: every artefact is taken for a large one


class Log(Protocol):
    """Where events go. While it is entered no other thread or process can add any."""

    def __enter__(self) -> object: ...
    def __exit__(self, *error: object) -> None: ...
    def add(self, event: Event) -> None: ...


class Events(list[Event]):
    """The events of this process."""

    def __init__(self) -> None:
        super().__init__()
        self._lock = threading.RLock()

    def __enter__(self) -> None:
        self._lock.acquire()

    def __exit__(self, *error: object) -> None:
        self._lock.release()

    add = list.append


class EventFile:
    """The events of several processes, in one file."""

    def __init__(self, path: Path) -> None:
        self._file = path.open("ab", buffering=0)
        self._lock = threading.RLock()

    def __enter__(self) -> None:
        self._lock.acquire()
        fcntl.flock(self._file, fcntl.LOCK_EX)

    def __exit__(self, *error: object) -> None:
        fcntl.flock(self._file, fcntl.LOCK_UN)
        self._lock.release()

    def add(self, event: Event) -> None:
        self._file.write(pickle.dumps(event))


def events_in(path: Path) -> list[Event]:
    """What an ``EventFile`` holds."""
    events = []
    with path.open("rb") as file:
        while file.peek(1):
            events.append(pickle.load(file))
    return events


@contextmanager
def recording(folder: Path, log: Log) -> Iterator[None]:
    """Add to ``log`` what this process does to what lies under ``folder``, for the time of a ``with``."""
    real = {name: getattr(os, name) for name in CALLS if hasattr(os, name)}
    recorder = _Recorder(str(folder), log, real)
    with ExitStack() as stack:
        for name in real:
            stack.enter_context(patch.object(os, name, getattr(recorder, name)))
        yield


CALLS = ("open", "pwrite", "posix_fallocate", "fsync", "mkdir", "replace", "unlink", "rmdir")


class _Recorder:
    """Stands in for ``os``. A call is recorded once it has succeeded, with nothing of others in between."""

    def __init__(self, folder: str, log: Log, real: dict[str, Any]) -> None:
        self._folder = folder
        self._log = log
        self._real = real
        self._paths: dict[int, str] = {}  # of descriptors
        for name in ("mkdir", "unlink", "rmdir"):
            setattr(self, name, self._of_a_path(name, "mkdir" if name == "mkdir" else "remove"))

    def open(self, path: Any, flags: int, *args: Any, **kwargs: Any) -> int:
        name = os.path.abspath(path)
        with self._log:
            existed = os.path.lexists(name)
            descriptor: int = self._real["open"](path, flags, *args, **kwargs)
            self._paths[descriptor] = name
            if self._within(name) and flags & (os.O_CREAT | os.O_RDWR | os.O_WRONLY):
                self._log.add(("holds", name, Path(name).read_bytes()) if existed else ("create", name))
        return descriptor

    def pwrite(self, descriptor: int, content: Any, place: int) -> int:
        with self._log:
            written: int = self._real["pwrite"](descriptor, content, place)
            self._note(descriptor, "write", place, bytes(content)[:written])
        return written

    def posix_fallocate(self, descriptor: int, start: int, size: int) -> None:
        with self._log:
            self._real["posix_fallocate"](descriptor, start, size)
            self._note(descriptor, "extend", start + size)

    def fsync(self, descriptor: int) -> None:
        with self._log:  # the disk itself is not waited for
            self._note(descriptor, "sync")

    def replace(self, source: Any, target: Any) -> None:
        with self._log:
            self._real["replace"](source, target)
            if self._within(os.path.abspath(target)):
                self._log.add(("move", os.path.abspath(source), os.path.abspath(target)))

    def _of_a_path(self, call: str, kind: str) -> Any:
        def recorded(path: Any, *args: Any, **kwargs: Any) -> None:
            with self._log:
                self._real[call](path, *args, **kwargs)
                if self._within(os.path.abspath(path)):
                    self._log.add((kind, os.path.abspath(path)))

        return recorded

    def _note(self, descriptor: int, kind: str, *what: Any) -> None:
        path = self._paths.get(descriptor, "")
        if self._within(path):
            self._log.add((kind, path, *what))

    def _within(self, path: str) -> bool:
        return path == self._folder or path.startswith(f"{self._folder}/")


class _Saying(io.TextIOBase):
    """A stream whose texts are events too."""

    def __init__(self, stream: TextIO, log: Log) -> None:
        self._stream = stream
        self._log = log

    def write(self, text: str, /) -> int:
        with self._log:
            self._log.add(("say", text))
        return self._stream.write(text)

    def flush(self) -> None:
        self._stream.flush()


def record_commands(stack: ExitStack) -> None:
    """Record this process until ``stack`` is left, as its environment says."""
    log = EventFile(Path(os.environ[LOG]))
    stack.enter_context(recording(Path(os.environ[FOLDER]), log))
    if LARGE in os.environ:
        from tests.large import large_from

        stack.enter_context(large_from(0))
    for name in ("stdout", "stderr"):
        stack.enter_context(patch.object(sys, name, _Saying(getattr(sys, name), log)))


def main(argv: list[str]) -> int:
    from koopcli.__main__ import main as koop

    with ExitStack() as stack:
        record_commands(stack)
        return koop(argv)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
elif __name__ == "__mp_main__":  # a worker of such a command, until it ends
    until_the_end = ExitStack()  # left by nobody
    record_commands(until_the_end)
