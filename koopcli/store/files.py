"""Durable files: write beside, fsync, rename, fsync of the folder. Nothing is ever written under its final name."""

from __future__ import annotations

import errno
import io
import os
import resource
import secrets
import shutil
import socket
import stat
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

from koopcli.errors import DamagedArtefactError, StorageError
from koopcli.store.remedies import FULL, remedy

HOUR, DAY = 3600.0, 86400.0
YOUNG = 60.0  # seconds after which a system has written what it was given, synced or not
PIECE = 16 << 20  # bytes read and written at a time
JSON_LIMIT = 16 << 20  # bytes of a record or a pin


class UntrustedFileError(DamagedArtefactError):
    """A file that koop did not write. The text is the reason alone: a caller that knows what the file is names it."""


@contextmanager
def storage_errors(path: Path, needed: float = 0) -> Iterator[None]:
    """Turn an ``OSError`` of writing to ``path`` into one line: what failed and what to do.

    On a full disk, that includes what was ``needed`` and what is free.
    """
    try:
        yield
    except OSError as error:
        room = f" ({size_text(needed)} needed, {size_text(_free(path))} free)" if error.errno in FULL else ""
        raise StorageError(f"cannot write to the store at {path}: {_reason(error)}{room}; {remedy(error)}") from error


@contextmanager
def reading_errors(path: Path) -> Iterator[None]:
    """Turn an ``OSError`` of reading ``path`` into one line. A missing file stays what it is."""
    try:
        yield
    except FileNotFoundError:
        raise
    except OSError as error:
        raise StorageError(f"cannot read {path}: {_reason(error)}; {remedy(error)}") from error


def _reason(error: OSError) -> str:
    text = os.strerror(error.errno) if error.errno else (str(error).splitlines() or ["unknown"])[0]
    return f"{text}: {error.filename}" if error.filename else text


class Published(NamedTuple):
    """A file as it was when it got its name: another process may move it away at once."""

    path: Path
    size: int
    mtime: float


def publish(target: Path | Callable[[Path], Path], fill: bytes | Callable[[Path], None], temporary: Path) -> Published:
    """Put a file at ``target``: whole or not at all, and on the disk when this returns.

    ``fill`` is the content, or writes it to the path it is given; ``target`` is the path, or finds it from the
    finished file; ``temporary`` is a folder on the same file system.
    """
    if not temporary.is_dir():
        make_folder(temporary)
    beside = temporary / own_name()
    try:
        if isinstance(fill, bytes):
            write_new(beside, fill)
        else:
            fill(beside)
            sync(beside)
        final = target if isinstance(target, Path) else target(beside)
        make_folder(final.parent)
        about = beside.stat()
        os.replace(beside, final)
    except BaseException:
        with suppress(OSError):
            beside.unlink(missing_ok=True)
        raise
    sync(final.parent)
    return Published(final, about.st_size, about.st_mtime)


def own_name() -> str:
    """A name that no other process gives to a file, and that says which process gave it."""
    return f"{os.getpid()}-{secrets.token_hex(8)}@{socket.gethostname()}"


@contextmanager
def open_regular(path: Path, flags: int = os.O_NOFOLLOW) -> Iterator[tuple[io.FileIO, int]]:
    """The regular file at ``path`` and its size; ``flags`` 0 follows a link, which only a user's own path may be.

    Raises ``UntrustedFileError`` for a link, folder, pipe or device put in its place, without waiting for it.
    """
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC | flags)
    except OSError as error:
        if error.errno in (errno.ELOOP, errno.ENXIO):  # a link, a socket
            raise UntrustedFileError("it is not a regular file") from error
        raise
    try:
        status = os.fstat(descriptor)
        if not stat.S_ISREG(status.st_mode):
            raise UntrustedFileError("it is not a regular file")
        with open(descriptor, "rb", buffering=0, closefd=False) as file:
            yield file, status.st_size
    finally:
        os.close(descriptor)


def read_small(path: Path) -> bytes:
    """The content of a record or a pin. Raises ``UntrustedFileError`` for anything but a regular file."""
    with open_regular(path) as (file, size):
        if size > JSON_LIMIT:
            raise UntrustedFileError(f"it is over {size_text(JSON_LIMIT)}")
        return file.read(JSON_LIMIT)


def write_new(path: Path, content: bytes, mode: int | None = None) -> None:
    """Write ``content`` to a new file, and sync it. Its ``mode`` is the usual one unless given."""
    descriptor = os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666)
    try:
        if mode is not None:
            with suppress(PermissionError):  # of a file system without modes
                os.fchmod(descriptor, mode)
        write_at(descriptor, memoryview(content), 0)
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def sync(path: Path) -> None:
    """Make the content of a file last, or the names in a folder."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def sync_young(path: Path, *before: Path) -> None:
    """Sync a file and its folder, after others that belong ``before`` it, if the file is younger than a minute.

    Another process may just have put it there and not have synced it; a time in the future says as little. Where
    syncing fails, as in a read-only store, the file is as good to read as before.
    """
    with suppress(OSError):
        if path.stat().st_mtime > time.time() - YOUNG:
            for file in (*before, path):
                sync(file)
                sync(file.parent)


def make_folder(path: Path) -> None:
    """Create ``path`` and its parents durably.

    One that is there and empty may have been made by another process that has not synced it. Whoever put the first
    file into a folder had synced the folder before.
    """
    if not path.is_dir():
        make_folder(path.parent)
        path.mkdir(exist_ok=True)
    elif not _is_empty(path) or not os.access(path.parent, os.R_OK):
        return
    sync(path.parent)


def sweep(temporary: Path, now: float) -> None:
    """Remove what dead processes left: after a day, or after an hour when their process is known to be gone."""
    for path in temporary.iterdir():
        with suppress(OSError):
            age = now - path.stat().st_mtime
            if age > DAY or (age > HOUR and _orphaned(path.name)):
                path.unlink()


def write_at(descriptor: int, content: memoryview, place: int) -> None:
    """Write all of ``content``, which one call may not."""
    while content:
        written = os.pwrite(descriptor, content, place)
        content, place = content[written:], place + written


def reserve(descriptor: int, size: int) -> None:
    """Take the disk's space for a file of ``size`` bytes that has holes; what it holds stays as it is."""
    if hasattr(os, "posix_fallocate"):
        os.posix_fallocate(descriptor, 0, size)
        return
    for place in range(0, size, PIECE):  # macOS lacks that call: the zeros that a hole reads as are written
        write_at(descriptor, memoryview(os.pread(descriptor, min(PIECE, size - place), place)), place)


def refuse_without_room(path: Path, needed: float) -> None:
    """Raise ``OSError`` where a file of ``needed`` bytes would not fit: on the disk, or in what a process may write."""
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)[0]
    if resource.RLIM_INFINITY != limit < needed:
        raise OSError(errno.EFBIG, os.strerror(errno.EFBIG))
    refuse_on_full_disk(path, needed)


def refuse_on_full_disk(path: Path, needed: float) -> None:
    """Raise ``OSError`` where the disk has no room for ``needed`` bytes."""
    if needed > _free(path):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def size_text(size: float) -> str:
    """Bytes for people: 13.8 MB."""
    for unit in ("B", "kB", "MB", "GB"):
        if size < 1000:
            return f"{size:.0f} {unit}" if unit == "B" else f"{size:.1f} {unit}"
        size /= 1000
    return f"{size:.1f} TB"


def _is_empty(folder: Path) -> bool:
    with os.scandir(folder) as entries:
        return next(entries, None) is None


def _orphaned(name: str) -> bool:
    process, _, host = name.partition("@")
    pid = process.partition("-")[0]
    if host != socket.gethostname() or not pid.isdigit():
        return False
    try:
        os.kill(int(pid), 0)
    except ProcessLookupError:
        return True
    except OSError:
        return False
    return False


def _free(path: Path) -> int:
    for folder in (path, *path.absolute().parents):
        with suppress(OSError):
            return shutil.disk_usage(folder).free
    return 0
