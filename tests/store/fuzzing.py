"""Reads files with a few bytes changed, in a process of its own, which HDF5 may bring down. Prints how many it refused.

Usage: python -m tests.store.fuzzing <folder> <first seed> <count>
"""

from __future__ import annotations

import faulthandler
import io
import random
import sys
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np

from koopcli.errors import DamagedArtefactError, InvalidValueError
from koopcli.records import Packed
from koopcli.store import Record, Store, digests, image
from tests.store.checksums import sums, with_sums
from tests.store.hostile import describe, put_facts


def sources() -> list[bytes]:
    """Files as koop writes them, and as they come back from being packed in chunks."""
    found = []
    for options in ({}, {"chunks": (4,), "compression": "gzip", "shuffle": True}):
        with h5py.File.in_memory(libver=("v110", "v110")) as file:
            put_facts(file, '{"dt": 0.1}')
            for i, kind in enumerate(("?", "<i8", "<f8")):
                describe(file.create_dataset(f"group/{i}", data=np.arange(6).astype(kind), **options))
            file.flush()
            found.append(bytes(file.id.get_file_image()))
    return found


def changed(source: bytes, places: list[tuple[int, int]], chance: random.Random) -> bytes:
    """Some bytes changed; every other time where it matters, with the checksums put right."""
    content = bytearray(source)
    guarded = chance.random() < 0.5
    for _ in range(chance.choice((1, 1, 2, 4))):
        start, end = chance.choice(places) if guarded else (0, len(content))
        at = chance.randrange(start, end)
        content[at] = chance.choice((0, 1, 4, 8, 255, chance.randrange(256), content[at] ^ 1 << chance.randrange(8)))
    return with_sums(content, places) if guarded else bytes(content)


def tried(read: Callable[[], Packed], refusal: type[Exception]) -> list[bytes] | str:
    """What was read, or nothing where it was refused in one line; anything else ends the process."""
    try:
        packed = read()
    except refusal as error:
        return "" if len(str(error).splitlines()) == 1 else str(error)
    return [np.asarray(array.values[...]).tobytes() for array in packed.arrays.values()]


def main(folder: Path, first: int, count: int) -> None:
    faulthandler.enable()
    store = Store(folder / "store")
    known = [(source, sums(source)) for source in sources()]
    usual = digests.WHOLE, image.MEMORY_LIMIT
    refused = 0
    for seed in range(first, first + count):
        chance = random.Random(seed)
        content = changed(*known[seed % 2], chance)
        digests.WHOLE, image.MEMORY_LIMIT = chance.choice((usual, (0, 0)))
        digest, slabs = digests.named(io.BytesIO(content))
        record = Record({"stage": "sample", "seed": seed}, {}, digest, len(content), digest, {})
        path = store.path(record)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
        digests.slabs_path(path).write_bytes(slabs)
        (folder / "seed").write_text(f"{seed}")
        faulthandler.dump_traceback_later(20, exit=True)
        outcome = (
            tried(lambda p=path: image.read_foreign(p), InvalidValueError),
            tried(lambda r=record: store.read(r), DamagedArtefactError),
        )
        assert outcome[0] == outcome[1]
        refused += outcome[0] == ""
    print(refused)


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]))
