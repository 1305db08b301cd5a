"""Locks: one process makes an artefact while others wait for it. Correctness never rests on them."""

from __future__ import annotations

import errno
import fcntl
import math
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from filelock import FileLock, Timeout

from koopcli.errors import InvalidValueError, LockTimeoutError
from koopcli.store.files import make_folder, storage_errors

LOCK_TIMEOUT = "KOOP_LOCK_TIMEOUT"
WITHOUT_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.ENOTSUP, errno.EOPNOTSUPP, errno.EINVAL)


@contextmanager
def hold(path: Path, name: str, warn: Callable[[str], None]) -> Iterator[None]:
    """Hold the lock at ``path`` while making ``name``. On a file system without locks, warn and go on.

    Raises ``LockTimeoutError`` where another process holds it for longer than ``$KOOP_LOCK_TIMEOUT`` seconds.
    """
    lock = FileLock(path)
    with storage_errors(path):
        make_folder(path.parent)
    try:
        lock.acquire(timeout=0)
    except Timeout:
        warn(f"waiting for another process that is making {name}")
        _wait(lock, name)
    except (NotImplementedError, OSError) as error:
        if isinstance(error, OSError) and error.errno not in WITHOUT_LOCKS:
            with storage_errors(path):
                raise
        warn("this file system has no locks: two processes may make the same artefact twice")
    try:
        yield
    finally:
        lock.release()


@contextmanager
def if_free(path: Path) -> Iterator[bool]:
    """Whether nobody holds the lock at ``path``, nor can take it for the time of a ``with``. Creates no file."""
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    except OSError as error:
        yield isinstance(error, FileNotFoundError)
        return
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:  # held, or a file system that cannot say
            free = False
        else:
            free = True
        yield free
    finally:
        os.close(descriptor)


def _wait(lock: FileLock, name: str) -> None:
    text = os.environ.get(LOCK_TIMEOUT, "3600")
    try:
        seconds = float(text)
    except ValueError:
        seconds = math.nan
    if not 0 <= seconds < math.inf:
        raise InvalidValueError(f"{LOCK_TIMEOUT} must be a number of seconds, got {text!r}")
    try:
        lock.acquire(timeout=seconds)
    except Timeout as error:
        raise LockTimeoutError(
            f"another process has been making {name} for over {seconds:g} s: wait for it, or raise {LOCK_TIMEOUT}"
        ) from error
