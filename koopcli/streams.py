"""stdout and stderr of a command, which is never stopped by those who read them.

Whoever reads the log may leave, or the disk that it goes to may be full: the work goes on without it. Whoever reads
the output may leave too, as ``head`` does: the rest of it goes nowhere, and the exit code still tells of the work.
Only output that cannot be kept, on a full disk say, is an error.
"""

from __future__ import annotations

import errno
import io
import os
import select
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, TextIO

from koopcli.errors import StorageError

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer


@contextmanager
def unstoppable() -> Iterator[None]:
    """For the time of a ``with``: ``sys.stdout`` and ``sys.stderr`` that cannot stop the work.

    Neither fails for its encoding, nor for having been closed before we began. Writing to stdout, or flushing it,
    raises ``StorageError`` where the output cannot be kept.
    """
    before = sys.stdout, sys.stderr
    sys.stdout = _guarded(sys.stdout, lambda error: error.errno == errno.EPIPE)
    sys.stderr = _guarded(sys.stderr, lambda error: True)
    try:
        yield
    finally:
        for stream in (sys.stdout, sys.stderr):
            with suppress(StorageError):  # said already, by the flush of whoever cares
                stream.flush()
        sys.stdout, sys.stderr = before


class _Descriptor(io.FileIO):
    """The file of a stream. What is ``forgiven`` looks like success; of anything else only the first write tells."""

    def __init__(self, descriptor: int, forgiven: Callable[[OSError], bool]) -> None:
        super().__init__(descriptor, "w", closefd=False)
        self._forgiven = forgiven
        self._lost = False

    def write(self, content: ReadableBuffer, /) -> int:
        """Write what fits; returns how many bytes are done with."""
        size = memoryview(content).nbytes
        while not self._lost:
            try:
                written = super().write(content)
            except OSError as error:
                if self._forgiven(error):
                    return size
                self._lost = True
                raise StorageError(f"cannot write the output: {error.strerror}") from error
            if written is not None:
                return written
            select.select((), (self,), ())  # of a stream that others made non-blocking
        return size


def _guarded(stream: TextIO | None, forgiven: Callable[[OSError], bool]) -> TextIO:
    """``stream`` with a file that forgives; one without a descriptor cannot fail, and stays what it is."""
    try:
        descriptor = os.open(os.devnull, os.O_WRONLY) if stream is None else stream.fileno()
    except (AttributeError, OSError):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")
        assert stream is not None, "the null device can be opened"
        return stream
    if stream is not None:
        with suppress(OSError):
            stream.flush()
    return io.TextIOWrapper(
        io.BufferedWriter(_Descriptor(descriptor, forgiven)),
        encoding=getattr(stream, "encoding", "utf-8"),
        errors="replace",
        line_buffering=getattr(stream, "line_buffering", True),
        write_through=getattr(stream, "write_through", False),
    )
