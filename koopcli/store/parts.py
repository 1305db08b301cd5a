"""Chunks of an unfinished artefact, each committed by itself and named by its number and digest."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from koopcli.records import Packed
from koopcli.store import image
from koopcli.store.files import storage_errors

Put = Callable[[Packed, Callable[[str], Path]], Path]
"""Write a record durably to the path found from the digest of its bytes."""


class Parts:
    """The chunks in ``folder``."""

    def __init__(self, folder: Path, put: Put) -> None:
        self._folder = folder
        self._put = put

    def read(self, i: int) -> Packed | None:
        """Chunk ``i``, verified, or None."""
        with storage_errors(self._folder):
            for path in sorted(self._folder.glob(f"{i}-*.h5")):
                content = path.read_bytes()
                if hashlib.sha256(content).hexdigest() == path.stem.partition("-")[2]:
                    return image.from_bytes(content)
                path.unlink()
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
