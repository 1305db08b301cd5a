"""Chunks of an unfinished artefact, each committed by itself: number, digest and the code that made it are its name."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection
from contextlib import suppress
from pathlib import Path
from typing import IO

from koopcli.records import Packed
from koopcli.store import image
from koopcli.store.code import code_digest
from koopcli.store.digests import sha256
from koopcli.store.files import Published, UntrustedFileError, open_regular, storage_errors, sync

HELD = 64 << 20  # bytes of the chunks of one artefact that are held in memory; others are read where they are needed
CHUNK = re.compile(r"(\d+)-([0-9a-f]{64})(?:-([0-9a-f]{64}))?\.h5")  # number, digest, code, which was not told once
Put = Callable[[Packed, Callable[[IO[bytes]], Path]], Published]
"""Write a record durably to the path found from its bytes."""


class Parts:
    """The chunks in ``folder``."""

    def __init__(self, folder: Path, put: Put) -> None:
        self._folder = folder
        self._put = put
        self._room = HELD

    def read(self, numbers: Collection[int]) -> dict[int, Packed]:
        """Those of the chunks ``numbers`` that this code made, verified; a damaged one is removed."""
        parts: dict[int, Packed] = {}
        with storage_errors(self._folder):
            for path in self._files():
                match = _own(path)
                if match and int(match[1]) in numbers and int(match[1]) not in parts:
                    packed = self._verified(path, match[2])
                    if packed is None:
                        path.unlink(missing_ok=True)
                    else:
                        parts[int(match[1])] = packed
        return parts

    def size(self) -> int:
        """Bytes of what is there."""
        with storage_errors(self._folder):
            return sum(path.stat().st_size for path in self._files())

    def commit(self, i: int, packed: Packed) -> None:
        """Store chunk ``i``."""
        self._put(packed, lambda file: self._folder / f"{i}-{sha256(file)}-{code_digest()}.h5")

    def drop_others(self) -> int:
        """Remove the chunks of other code, and those that do not say whose they are; returns how many those were."""
        with storage_errors(self._folder):
            others = [path for path in self._files() if path.suffix == ".h5" and not _own(path)]
            for path in others:
                path.unlink(missing_ok=True)
        return len(others)

    def drop(self, first: int) -> None:
        """Remove chunk ``first`` and all after it, for good: they were made with something else."""
        with storage_errors(self._folder):
            matches = [(path, CHUNK.fullmatch(path.name)) for path in self._files()]
            others = [path for path, match in matches if match and int(match[1]) >= first]
            for path in others:
                path.unlink(missing_ok=True)
            if others:
                sync(self._folder)

    def clear(self) -> None:
        """Remove the chunks: the finished artefact holds them."""
        with suppress(OSError):
            for path in self._folder.iterdir():
                path.unlink()
            self._folder.rmdir()

    def _files(self) -> list[Path]:
        try:
            return sorted(self._folder.iterdir())
        except FileNotFoundError:
            return []

    def _verified(self, path: Path, digest: str) -> Packed | None:
        """The chunk at ``path``, if it is what its name says."""
        try:
            with open_regular(path) as (file, size):
                if sha256(file) != digest:
                    return None
                if size > self._room:
                    return image.from_path(path)
                self._room -= size
                file.seek(0)
                return image.from_bytes(file.read())
        except (FileNotFoundError, UntrustedFileError):
            return None


def _own(path: Path) -> re.Match[str] | None:
    """What the name of a chunk says, if this code made it."""
    match = CHUNK.fullmatch(path.name)
    return match if match and match[3] == code_digest() else None
