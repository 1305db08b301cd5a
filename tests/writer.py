"""A process to be killed: it commits artefacts one after another and names each on stdout once it is committed.

python -m tests.writer STORE FIRST COUNT
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np

from koopcli.records import Array, Packed
from koopcli.store import Record, Store, image
from koopcli.store.identity import SCHEMA

KEYS = 40


def content(seed: int) -> Packed:
    """Its values say whose they are."""
    return Packed({"x": Array(seed + np.arange(4000.0), ("row",), "m")}, {"seed": seed})


def recipe(seed: int) -> dict[str, Any]:
    return {"schema": SCHEMA, "stage": "sample", "version": 1, "settings": {"seed": seed}, "inputs": {}}


def commit(store: Store, seed: int) -> Record:
    return store.commit(recipe(seed), {}, content(seed), {"time": "2026-01-01", "seconds": 0.0})


def main(root: str, first: int, count: int) -> None:
    store = Store(Path(root))
    usual = image.IMAGE_LIMIT
    for seed in range(first, first + count):
        image.IMAGE_LIMIT = 0 if seed % 2 else usual  # every other one as if it were large
        commit(store, seed % KEYS)
        print(seed % KEYS, flush=True)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
