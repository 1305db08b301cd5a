"""``make scaling``: what more samples, more processes and other engines cost, for docs/scaling.md (minutes).

Every figure is of one run on one machine; ratios are within it.
"""

from __future__ import annotations

import os
import re
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from run import KOOP, command, row

from koopcli.stages.workers import Workers

SAMPLES = (100_000, 1_000_000, 10_000_000)
STEPS = 30
JOBS = 400
SWEEP = ["sweep", "--set", "fit-edmd.order=4:7", "--set", "fit-edmd.terms=linear,bilinear", "--set", "sample.seed=0:2"]
ONE_THREAD = os.environ | {f"{library}_NUM_THREADS": "1" for library in ("OPENBLAS", "OMP", "MKL")}


def nothing(job: int) -> int:
    return job


@contextmanager
def cluster(workers: int = 2) -> Iterator[str]:
    """The address of a Dask scheduler on loopback with so many workers of one thread."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    address = f"tcp://127.0.0.1:{port}"
    parts = [
        ["scheduler", "--host", "127.0.0.1", "--port", str(port)],
        *[["worker", address, "--nthreads", "1"]] * workers,
    ]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "env": ONE_THREAD}
    begun = [
        subprocess.Popen(
            [sys.executable, "-m", f"distributed.cli.dask_{part[0]}", *part[1:], "--no-dashboard"], **quiet
        )
        for part in parts
    ]
    try:
        from distributed import Client

        with Client(address, timeout=30, set_as_default=False) as client:
            client.wait_for_workers(workers, timeout=60)
        yield address
    finally:
        for process in reversed(begun):
            process.terminate()
            process.wait()


def engines(address: str) -> dict[str, list[str]]:
    """Each engine by name, as options of a command."""
    return {
        "this process": [],
        "two processes": ["--workers", "2"],
        "Dask, two workers": ["--cluster", address],
    }


def per_job(folder: Path, address: str) -> None:
    """Seconds from one empty job to the next."""
    for name, workers in (
        ("this process", Workers()),
        ("two processes", Workers(2)),
        ("Dask, two workers", Workers(cluster=address)),
    ):
        with workers:
            list(workers.each(nothing, range(20), folder))  # those that start are up
            clock = time.perf_counter()
            list(workers.each(nothing, range(JOBS), folder))
            row(f"an empty job, {name}: ms", f"{1e3 * (time.perf_counter() - clock) / JOBS:.2f}", "")


def per_chunk(folder: Path, address: str) -> None:
    """What a chunk costs beside its work: a fit of order 1 in ten times as many chunks as the same in few."""
    data = ["--set", "sample.kind=box", "--set", "sample.count=4000", "--set", "sample.steps=1"]
    for name, options in engines(address).items():
        walls = {}
        for chunk in (400, 200, 20):  # the first also wakes the workers of a cluster
            store = folder / re.sub(r"\W", "", f"chunks{chunk}{name}")
            command(*KOOP, "simulate", *data, "--store", str(store), env=ONE_THREAD)
            fit = [
                "fit-edmd",
                *data,
                "--order",
                "1",
                "--set",
                f"fit-edmd.chunk={chunk}",
                "--store",
                str(store),
                *options,
            ]
            walls[chunk] = command(*fit, env=ONE_THREAD)["wall"]
        more = 2 * (4000 // 20 - 4000 // 200)  # in both passes
        row(f"a committed chunk beside its work, {name}: ms", f"{1e3 * (walls[20] - walls[200]) / more:.1f}", "")


def samples(folder: Path) -> None:
    """One fit of order 7 after another, on more and more samples."""
    for count in SAMPLES:
        store = folder / f"samples-{count}"
        what = ["sample.kind=box", f"sample.count={count // STEPS}", f"sample.steps={STEPS}", "sample.amplitude=100"]
        told = [word for one in what for word in ("--set", one)]
        simulated = command(*KOOP, "simulate", *told, "--store", str(store), env=ONE_THREAD)
        fit = command(*KOOP, "fit-edmd", *told, "--store", str(store), env=ONE_THREAD)
        row(
            f"order 7 on {count:,} samples, one process: CPU s, MB resident (the simulation: CPU s)",
            f"{fit['cpu']:.1f}, {fit['memory']:.0f} ({simulated['cpu']:.1f})",
            "",
        )
        if count == SAMPLES[1]:
            both = command(
                *KOOP, "fit-edmd", *told, "--set", "fit-edmd.chunk=100000", "--workers", "2", "--store", str(store),
                env=ONE_THREAD,
            )  # fmt: skip
            row(
                "the same by two processes, in chunks of 100 000: wall s, one / two",
                f"{fit['wall']:.1f} / {both['wall']:.1f}",
                "",
            )
        subprocess.run(["rm", "-rf", str(store)], check=True)


def sweeps(folder: Path, address: str) -> None:
    """A grid of 24 cells by each engine."""
    walls = {}
    for name, options in engines(address).items():
        store = folder / re.sub(r"\W", "", f"sweep{name}")
        walls[name] = command(*KOOP, *SWEEP, "--store", str(store), *options, env=ONE_THREAD)["wall"]
        ratio = walls["this process"] / walls[name]
        row(f"a sweep of 24 cells, {name}: wall s, times quicker", f"{walls[name]:.1f}, {ratio:.2f}", "≥ 1.7")


def main() -> None:
    print("| what | measured | aim |\n|---|---|---|")
    with tempfile.TemporaryDirectory(prefix="koop-scaling-") as name, cluster() as address:
        per_job(Path(name), address)
        per_chunk(Path(name), address)
        sweeps(Path(name), address)
        samples(Path(name))


if __name__ == "__main__":
    main()
