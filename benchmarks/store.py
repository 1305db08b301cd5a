"""What the store costs: commits and reads beside plain files, many artefacts, two gigabytes, and what workers save.

``python benchmarks/store.py`` prints a table; the last rows take minutes and 6 GB of disk.
"""

from __future__ import annotations

import hashlib
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from run import KOOP, command, row

from koopcli.records import Array, Packed
from koopcli.store import Store
from koopcli.store.identity import SCHEMA

RUNS = 9
CHUNKS = 27


def packed(megabytes: float, seed: int) -> Packed:
    values = np.random.default_rng(seed).standard_normal(int(megabytes * 1e6 / 8))
    return Packed({"x": Array(values, ("row",), "1")}, {"seed": seed})


def recipe(seed: int) -> dict:
    return {"schema": SCHEMA, "stage": "sample", "version": 1, "settings": {"seed": seed}, "inputs": {}}


def timed(work: Callable[[], object]) -> float:
    clock = time.perf_counter()
    work()
    return 1e3 * (time.perf_counter() - clock)


def write(path: Path, content: bytes) -> None:
    with path.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def beside(what: str, ours: list[float], plain: list[float], aim: str) -> None:
    a, b = statistics.median(ours), statistics.median(plain)
    row(what, f"{a:.0f} / {b:.0f} = {a / b:.1f}", aim)


def commits(work: Path) -> None:
    store = Store(work / "commits")
    store.commit(recipe(-1), {}, packed(0.1, 0), {})
    puts, plain_puts, gets, plain_gets = [], [], [], []
    for i in range(RUNS):
        data = packed(16, i)
        content = data.arrays["x"].values.tobytes()
        path = work / f"plain-{i}"
        puts.append(timed(lambda i=i, data=data: store.commit(recipe(i), {}, data, {})))
        plain_puts.append(timed(lambda path=path, content=content: write(path, content)))
        record = store.record("sample", Store(store.root).index()[i][1])
        gets.append(timed(lambda record=record: store.read(record)))
        plain_gets.append(timed(lambda path=path: hashlib.sha256(path.read_bytes()).hexdigest()))
    beside("commit of 16 MB, and a plain write with fsync: ms", puts, plain_puts, "≤ 250")
    beside("verified read of 16 MB, and reading with SHA-256: ms", gets, plain_gets, "≤ 60")

    ours, plain = [], []
    for i in range(RUNS):
        parts, data = store.parts(f"{i:064x}"), packed(0.3, i)
        content = data.arrays["x"].values.tobytes()
        ours.append(timed(lambda parts=parts, data=data: [parts.commit(k, data) for k in range(CHUNKS)]))
        plain.append(timed(lambda content=content: [write(work / f"part-{k}", content) for k in range(CHUNKS)]))
    beside(f"{CHUNKS} chunks of 0.3 MB committed, and plain writes with fsync: ms", ours, plain, "≤ 500")


def large(work: Path) -> None:
    """Two gigabytes of trajectories: made, then scored."""
    for count, steps in ((360_000, 100), (36_000, 1000)):
        where = ["--store", str(work / f"large-{count}")]
        size = ["--set", f"sample.count={count}", "--steps", str(steps), "--excitation", "held"]
        sample, predictor = (
            subprocess.run([*KOOP, *args, *where], check=True, capture_output=True, text=True).stdout.strip()
            for args in (["sample", "box", *size], ["fit-edmd", "--set", "fit-edmd.basis=total", "--order", "2"])
        )
        made = command(*KOOP, "simulate", sample, *where)
        path = next(iter((work / f"large-{count}" / "records" / "simulate").glob("*.json")))
        named = [path for path in path.parent.glob("*.json") if f'"steps": {steps}' in path.read_text()]
        trajectories = f"simulate/{named[0].stem}"
        size_gb = sum(p.stat().st_size for p in (work / f"large-{count}" / "objects").rglob("*.h5")) / 1e9
        scored = command(*KOOP, "evaluate", predictor, "--on", trajectories, *where)
        what = f"{count:,} trajectories × {steps} steps, {size_gb:.1f} GB".replace(",", " ")
        row(f"{what}, simulated: MB resident; wall s", f"{made['memory']:.0f}; {made['wall']:.0f}", "≤ 300 MB")
        row("the same scored, with what it is set beside", f"{scored['memory']:.0f}; {scored['wall']:.0f}", "≤ 300 MB")
        subprocess.run(["rm", "-rf", str(work / f"large-{count}")], check=True)


def shared(work: Path) -> None:
    for what, args in (
        ("3 375 trajectories on wheels", ["simulate", "--plant", "wheels"]),
        ("`koop reproduce all`", ["reproduce", "all"]),
    ):
        walls = [
            command(*KOOP, *args, "--workers", str(n), "--store", str(work / f"{args[0]}-{n}"))["wall"] for n in (1, 2)
        ]
        row(f"{what}: wall s by one process, and by two", f"{walls[0]:.0f} / {walls[1]:.0f}", "")


def main() -> None:
    print("| what | measured | aim |\n|---|---|---|")
    with tempfile.TemporaryDirectory(prefix="koop-bench-") as name:
        commits(Path(name))
        large(Path(name))
        shared(Path(name))


if __name__ == "__main__":
    sys.exit(main())
