"""Faults, counted: what a store loses, and what damage it takes for good, under each.

The tests run these a few times; ``python -m tests.faults`` runs them at length, power cuts during commands too, and
prints the tables of docs/reliability.md.
"""

from __future__ import annotations

import errno
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from koopcli.errors import DamagedArtefactError, StorageError
from koopcli.store import Record, Store
from koopcli.store.image import loaded
from tests.large import large_from
from tests.powercut import commands
from tests.writer import KEYS, LARGE, SLAB, commit, content

UNFINISHED = "f" * 64
CALLS = ("open", "pwrite", "fsync", "replace", "mkdir", "posix_fallocate")


@dataclass
class Count:
    """What came of a fault: how often it was ``injected``, how often it struck (a write was refused, a process died,
    damage was found), what was ``lost`` of what had been committed, and what damage was ``accepted`` on reading.
    """

    injected: int = 0
    struck: int = 0
    lost: int = 0
    accepted: int = 0


def good(store: Store, record: Record) -> bool:
    """Whether what is read is what was committed."""
    packed = loaded(store.read(record))
    expected = content(packed.meta["seed"])
    right = record.recipe["settings"]["seed"] == packed.meta["seed"]
    return right and bool((np.asarray(packed.arrays["x"].values) == expected.arrays["x"].values).all())


def settle(store: Store, committed: set[str], count: Count) -> None:
    """Count what is lost of ``committed`` keys, and what is wrong of all that the store shows."""
    shown = dict.fromkeys(key for _, key in store.index())
    for key in committed - shown.keys():
        count.lost += 1
        print(f"lost {key}", file=sys.stderr)
    for key in shown:
        record = store.record("sample", key)
        try:
            if record is None or not store.has_object(record):
                count.lost += key in committed
            elif not good(store, record):
                count.accepted += 1
        except DamagedArtefactError:
            count.lost += key in committed


@large_from(LARGE, SLAB)
def kills(folder: Path, times: int, writers: int, seed: int = 0) -> Count:
    """kill -9 of ``writers`` processes that commit to the same keys of one store, at random moments."""
    rng, count, committed = random.Random(seed), Count(), set()
    names = {i: commit(Store(folder / "names"), i).key for i in range(KEYS)}
    while count.injected < times:
        first = rng.randrange(KEYS)
        command = [sys.executable, "-m", "tests.writer", str(folder / "store"), str(first), "100000"]
        running = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(writers)]
        said = [process.stdout.readline() for process in running]  # begun
        time.sleep(rng.uniform(0.0, 0.15))
        for process in running:
            process.kill()
        for process, line in zip(running, said, strict=True):
            rest, _ = process.communicate()
            count.injected += 1
            count.struck += process.returncode < 0
            committed |= {names[int(text)] for text in f"{line}{rest}".splitlines() if text}
        settle(Store(folder / "store"), committed, count)
        if count.injected % 5 == 0:  # so that first commits are struck too, not only those of what is there
            shutil.rmtree(folder / "store")
            committed = set()
    return count


@contextmanager
def failing(call: str, n: int, code: int) -> Iterator[Callable[[], int]]:
    """Make the ``n``-th ``os.call`` fail for the time of a ``with``; gives how many there were."""
    real, calls = getattr(os, call), 0

    def counted(*args: object, **kwargs: object) -> object:
        nonlocal calls
        calls += 1
        if calls == n:
            raise OSError(code, os.strerror(code))
        return real(*args, **kwargs)

    setattr(os, call, counted)
    try:
        yield lambda: calls
    finally:
        setattr(os, call, real)


@large_from(LARGE, SLAB)
def errors(folder: Path, code: int) -> Count:
    """An error at the n-th call of each kind, for every n of a commit: the old state is left, or the new.

    For what is laid out in memory, for what is large, and for a chunk.
    """
    count = Count()
    for what, put, seed in (("small", commit, 2), ("large", commit, 1), ("chunk", chunk, 1)):
        for call in CALLS:
            reached, n = True, 0
            while reached:
                n += 1
                root, done = folder / f"{what}-{call}-{n}", False
                old = commit(Store(root), 0).key
                with failing(call, n, code) as calls:
                    try:
                        put(Store(root), seed)
                        done = True
                    except StorageError:
                        count.struck += 1
                    reached = calls() >= n
                count.injected += reached
                settle(Store(root), {old}, count)
                found = len(Store(root).index()) > 1 or 1 in Store(root).parts(UNFINISHED).read({1})
                count.lost += done and not found
                count.accepted += len(list((root / "tmp").iterdir()))
    return count


def chunk(store: Store, seed: int) -> None:
    """Commit a chunk of something unfinished."""
    store.parts(UNFINISHED).commit(seed, content(seed))


@large_from(LARGE, SLAB)
def damage(folder: Path, flips: int, cuts: int, which: int, seed: int = 0) -> tuple[Count, Count]:
    """Single bits flipped, and ends cut off, over the whole of the object ``which``: each is found when it is read."""
    rng, flipped, cut = random.Random(seed), Count(), Count()
    store = Store(folder / f"store-{which}")
    record = commit(store, which)
    path, whole = store.path(record), store.path(record).read_bytes()
    for count, times in ((flipped, flips), (cut, cuts)):
        for _ in range(times):
            if count is flipped:
                bad = bytearray(whole)
                bad[rng.randrange(len(whole))] ^= 1 << rng.randrange(8)
            else:
                bad = bytearray(whole[: rng.randrange(len(whole))])
            path.write_bytes(bad)
            count.injected += 1
            try:
                loaded(store.read(record))
                count.accepted += 1
            except DamagedArtefactError:
                count.struck += 1
            shutil.rmtree(store.root / "quarantine", ignore_errors=True)
    path.write_bytes(whole)
    assert good(store, record)
    return flipped, cut


def row(what: str, count: Count) -> None:
    print(f"| {what} | {count.injected} | {count.struck} | {count.lost} | {count.accepted} |", flush=True)


def main() -> None:
    print("| fault | injected | struck | committed and lost | damage accepted |\n|---|---|---|---|---|")
    with tempfile.TemporaryDirectory(prefix="koop-faults-") as name:
        work = Path(name)
        for writers, what in ((1, "kill -9 of a writer"), (2, "kill -9 of two writers on the same keys")):
            (work / str(writers)).mkdir()
            row(what, kills(work / str(writers), 1000, writers))
        for code, what in (
            (errno.EIO, "input/output error"),
            (errno.ENOSPC, "disk full"),
            (errno.EDQUOT, "quota used up"),
            (errno.EROFS, "read-only file system"),
            (errno.EACCES, "permission denied"),
        ):
            row(f"{what} at the n-th open, write, fsync, rename, …", errors(work / str(code), code))
        for which, kind in ((0, "an object"), (1, "a large object")):
            for what, count in zip(("a bit flipped", "an end cut off"), damage(work, 3000, 2000, which), strict=True):
                row(f"{what} in {kind}", count)
    commands.main([])


if __name__ == "__main__":
    main()
