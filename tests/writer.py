"""A process to be killed: it commits artefacts one after another and names each on stdout once it is committed.

python -m tests.writer STORE FIRST COUNT
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np

from koopcli.records import Array, Packed
from koopcli.store import Record, Store
from koopcli.store.identity import SCHEMA
from tests.large import large_from

KEYS = 40
ROWS = 4000  # 32 kB
LARGE, SLAB = 48_000, 1 << 14  # bytes of an object over which it is taken for large, and of its slabs


def content(seed: int) -> Packed:
    """Its values say whose they are. Those of odd seeds are large."""
    rows = 2 * ROWS if seed % 2 else ROWS
    return Packed({"x": Array(seed + np.arange(float(rows)), ("row",), "m")}, {"seed": seed})


def recipe(seed: int) -> dict[str, Any]:
    return {"schema": SCHEMA, "stage": "sample", "version": 1, "settings": {"seed": seed}, "inputs": {}}


def commit(store: Store, seed: int) -> Record:
    return store.commit(recipe(seed), {}, content(seed), {"time": "2026-01-01", "seconds": 0.0})


def main(root: str, first: int, count: int) -> None:
    store = Store(Path(root))
    with large_from(LARGE, SLAB):
        for seed in range(first, first + count):
            commit(store, seed % KEYS)
            print(seed % KEYS, flush=True)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
