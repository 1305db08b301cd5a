"""The digest that names an object, and reading by it: of a large object it is that of the digests of its slabs.

Those lie in a file beside it, so that who reads a part of the object verifies that part and little else.
"""

from __future__ import annotations

import hashlib
import io
import os
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any, NoReturn

from koopcli.store.files import UntrustedFileError, open_regular

WHOLE = 32 << 20  # bytes of an object up to which it is hashed as a whole
SLAB = 1 << 20  # bytes of a slab
DIGEST = 32  # bytes of a digest
WRONG = "its bytes are not those that were stored"


def sha256(file: IO[bytes]) -> str:
    """The digest of a file from where it stands."""
    return hashlib.file_digest(file, "sha256").hexdigest()  # type: ignore[arg-type]


def named(file: IO[bytes]) -> tuple[str, bytes]:
    """The name of the object with the bytes of ``file``, and the digests of its slabs; a small one has none."""
    size = file.seek(0, os.SEEK_END)
    file.seek(0)
    if size <= WHOLE:
        return sha256(file), b""
    digests = b"".join(hashlib.sha256(file.read(SLAB)).digest() for _ in range(0, size, SLAB))
    return hashlib.sha256(digests).hexdigest(), digests


def slabs_path(path: Path) -> Path:
    """Where the digests of the slabs of a large object lie."""
    return path.with_suffix(".slabs")


def digests_size(size: int) -> int:
    """Bytes of the digests of the slabs of a large object of ``size`` bytes."""
    return DIGEST * -(-size // SLAB)


def read_digests(path: Path, name: str, size: int) -> bytes:
    """The digests of the slabs of the object ``name`` at ``path``, of ``size`` bytes.

    Raises ``UntrustedFileError``, and ``FileNotFoundError`` where there are none.
    """
    wanted = digests_size(size)
    with open_regular(slabs_path(path)) as (file, length):
        digests = file.read() if length == wanted else b""
    if len(digests) != wanted or hashlib.sha256(digests).hexdigest() != name:
        raise UntrustedFileError("the digests of its slabs are not those that were stored")
    return digests


class VerifiedFile(io.FileIO):
    """A file whose slabs are verified by their ``digests`` when they are first read; other bytes raise.

    It is closed with the last array that is read from it.
    """

    def __init__(self, descriptor: int, digests: bytes, size: int) -> None:
        super().__init__(descriptor)
        self._digests, self._size = digests, size
        self._verified = bytearray(len(digests) // DIGEST)
        self.refuse: Callable[[VerifiedFile], NoReturn] = _refuse
        """What is done about a slab with other bytes. It must not hold the file, which would stay open then."""

    def __del__(self) -> None:
        self.close()

    def verify(self) -> None:
        """Read and verify every slab."""
        for number in range(len(self._verified)):
            self._slab(number)

    def readinto(self, buffer: Any, /) -> int:
        """Fill the ``buffer`` with verified bytes as far as there are any."""
        room = memoryview(buffer).cast("B")
        start = self.tell()
        stop = max(start, min(start + len(room), self._size))
        place = start
        while place < stop:
            number, within = divmod(place, SLAB)
            if self._verified[number]:
                end = min(self._end_of_verified(number), stop)
                self.seek(place)
                taken = super().readinto(room[place - start : end - start])
            else:
                part = self._slab(number)[within : within + stop - place]
                taken = len(part)
                room[place - start : place - start + taken] = part
            if not taken:
                self.refuse(self)
            place += taken
        self.seek(stop)
        return stop - start

    def _slab(self, number: int) -> bytes:
        content = os.pread(self.fileno(), SLAB, number * SLAB)
        if hashlib.sha256(content).digest() != self._digests[DIGEST * number : DIGEST * (number + 1)]:
            self.refuse(self)
        self._verified[number] = 1
        return content

    def _end_of_verified(self, number: int) -> int:
        """Where the verified slabs from ``number`` on end."""
        unverified = self._verified.find(0, number)
        return self._size if unverified < 0 else unverified * SLAB


def _refuse(file: VerifiedFile) -> NoReturn:
    raise UntrustedFileError(WRONG)
