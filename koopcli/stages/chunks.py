"""The chunks of one artefact: which are there, which are to be computed, here or by workers, each committed alone."""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from koopcli.blocks import blocks
from koopcli.errors import DamagedArtefactError
from koopcli.progress import Progress, silent, within
from koopcli.records import Packed
from koopcli.stages.base import Inputs
from koopcli.stages.recorded import content_of
from koopcli.stages.registry import STAGES
from koopcli.stages.workers import Workers, check_code
from koopcli.store import Store
from koopcli.store.identity import data_digest
from koopcli.store.parts import Parts


@dataclass(frozen=True)
class Chunk:
    """One chunk of one artefact. It names its inputs, by role, so that another process finds them in the store; where
    it runs in the process that has them it holds them, as ``at_hand``. ``start`` to ``stop`` are its rows; ``given``
    is the number of the part that holds what else it works with; ``code`` is the digest of the code that asks for it.
    """

    root: Path
    stage: str
    settings: Any
    key: str
    inputs: tuple[tuple[str, str], ...]
    i: int = 0
    start: int = 0
    stop: int = 0
    given: int | None = None
    code: str = ""
    at_hand: Inputs | None = None
    progress: Progress = silent

    def compute(self) -> Packed:
        """What the stage makes of these rows. Raises ``OtherCodeError`` where other code has sent them."""
        check_code(self.code)
        inputs = self.at_hand
        if inputs is None:
            inputs = {role: _content(self.root, name) for role, name in self.inputs}
            if self.given is not None:
                stored = _store(self.root).parts(self.key).read([self.given])
                if self.given not in stored:
                    raise _GoneError
                inputs |= {"given": stored[self.given]}
        chunk = STAGES[self.stage].chunk
        assert chunk is not None, "only a stage with chunks asks for them"
        return chunk(self.settings, inputs, slice(self.start, self.stop), self.progress)


def commit(chunk: Chunk) -> list[str]:
    """Compute a chunk and store it; returns what the store warned of. Without its inputs nothing is done."""
    warned: list[str] = []
    store = _store(chunk.root)
    store.warn = warned.append
    with suppress(_GoneError):
        store.parts(chunk.key).commit(chunk.i, _computed(chunk))
    return warned


def _computed(chunk: Chunk) -> Packed:
    """What a chunk makes. An input of another process that turns out damaged while it is read is one that is gone."""
    try:
        return chunk.compute()
    except DamagedArtefactError as error:
        if chunk.at_hand is not None:
            raise
        _content_of.cache_clear()
        raise _GoneError from error


@dataclass
class ChunkedWork:
    """What a stage calls for its chunks; see :class:`koopcli.stages.base.Chunks`."""

    store: Store
    whole: Chunk
    """The artefact, of which each chunk is a part."""
    workers: Workers
    progress: Progress
    note: Callable[[str], None]
    size: float = 0.0
    """About how many bytes the whole will have."""
    begun: int = 0
    """How many parts earlier calls have numbered."""

    def __call__(self, count: int, size: int, given: Packed | None = None, each: float = 0.0) -> list[Packed]:
        """The packed results of all slices of ``range(count)``, in order; large ones stay on disk."""
        whole, first = self.whole, self.begun
        if given is not None:
            assert whole.at_hand is not None, "here are the inputs"
            whole = replace(whole, given=first, at_hand={**whole.at_hand, "given": given})
            first += 1
        every = list(enumerate(blocks(slice(0, count), size), first))
        chunks = [self._chunk(whole, i, rows, count) for i, rows in every]
        self.begun = first + len(chunks)
        if len(chunks) == 1:
            return [chunks[0].compute()]
        parts = self.store.parts(whole.key)
        if others := parts.drop_others():
            self.note(f"{others} chunks were made by other code of koopcli: they are dropped and made again")
        chunked = max(self.size, each * len(chunks))
        self.store.require(chunked + self.size - parts.size())  # the chunks, then the whole beside them
        if given is not None:
            _settle(parts, first - 1, given)
        results = parts.read([chunk.i for chunk in chunks])
        missing = [chunk for chunk in chunks if chunk.i not in results]
        if len(missing) < len(chunks):
            self.note(f"{len(chunks) - len(missing)} of {len(chunks)} chunks were already there")
        alone, root = self.workers.alone, self.store.folder()
        jobs = missing if alone else [replace(chunk, root=root, at_hand=None, progress=silent) for chunk in missing]
        ready = count - sum(chunk.stop - chunk.start for chunk in missing)
        for chunk, warned in self.workers.each(commit, jobs, root):
            for text in warned:
                self.store.warn(text)
            ready += chunk.stop - chunk.start
            if not alone:
                self.progress(ready, count)
        results |= parts.read([chunk.i for chunk in missing])
        # Others may have cleared chunks where no lock keeps them away, or have removed the inputs of a worker.
        return [results[chunk.i] if chunk.i in results else chunk.compute() for chunk in chunks]

    def _chunk(self, whole: Chunk, i: int, rows: slice, count: int) -> Chunk:
        inside = within(self.progress, rows.start, rows.stop, count)
        return replace(whole, i=i, start=rows.start, stop=rows.stop, progress=inside)


def _settle(parts: Parts, number: int, given: Packed) -> None:
    """Let what chunks are given lie there as part ``number``. What an interrupted command left is gone on with only if
    it was given the same to the last bit: another machine's survey may choose other directions, as good as these.
    """
    stored = parts.read([number]).get(number)
    if stored is None or data_digest(stored) != data_digest(given):
        parts.drop(number)
        parts.commit(number, given)


class _GoneError(Exception):
    """An input is no longer in the store, or no longer good."""


def _store(root: Path) -> Store:
    """One store for each thread of a process, which sweeps litter once and has its own ear for warnings."""
    return _store_of(root, threading.get_ident())


@lru_cache(maxsize=64)
def _store_of(root: Path, thread: int) -> Store:
    return Store(root)


def _content(root: Path, name: str) -> Any:
    """The verified content of an input, kept from one chunk to the next while its record stays as it is."""
    record = _store(root).record(*name.split("/"))
    if record is None:
        raise _GoneError
    return _content_of(root, name, record.object)


@lru_cache(maxsize=4)
def _content_of(root: Path, name: str, digest: str) -> Any:
    store = _store(root)
    record = store.record(*name.split("/"))
    if record is None or record.object != digest:
        raise _GoneError
    try:
        return content_of(record, store)
    except DamagedArtefactError as error:
        raise _GoneError from error
