"""Chunks of an unfinished artefact, each committed by itself and named by its number and digest."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from koopcli.records import Packed
from koopcli.store import image
from koopcli.store.files import Published, UntrustedFileError, open_regular, storage_errors

SMALL = 4 << 20  # bytes; larger chunks are not held in memory
Put = Callable[[Packed, Callable[[str], Path]], Published]
"""Write a record durably to the path found from the digest of its bytes."""


class Parts:
    """The chunks in ``folder``."""

    def __init__(self, folder: Path, put: Put) -> None:
        self._folder = folder
        self._put = put

    def read(self, i: int) -> Packed | None:
        """Chunk ``i``, verified, or None; a large one stays on disk."""
        with storage_errors(self._folder):
            for path in sorted(self._folder.glob(f"{i}-*.h5")):
                found = _verified(path)
                if found is not None:
                    return found
                path.unlink(missing_ok=True)
        return None

    def commit(self, i: int, packed: Packed) -> None:
        """Store chunk ``i``."""
        self._put(packed, lambda sha: self._folder / f"{i}-{sha}.h5")

    def clear(self) -> None:
        """Remove the chunks: the finished artefact holds them."""
        with suppress(OSError):
            for path in self._folder.iterdir():
                path.unlink()
            self._folder.rmdir()


def _verified(path: Path) -> Packed | None:
    """The chunk at ``path``, if it is what its name says."""
    digest = path.stem.partition("-")[2]
    try:
        with open_regular(path) as (file, size):
            if size > SMALL:
                right = hashlib.file_digest(file, "sha256").hexdigest() == digest
                return image.from_path(path) if right else None
            content = file.read()
        return image.from_bytes(content) if hashlib.sha256(content).hexdigest() == digest else None
    except UntrustedFileError:
        return None
