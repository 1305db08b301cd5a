"""``make bench``: every speed figure of the project in one run, as ratios where a ratio is meant.

Tasks that are compared run in turn, A B A B …, each in its own process; medians of five. The machine is noisy and so
nothing here is ever asserted in a test.
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
KOOP = [sys.executable, "-m", "koopcli"]
RUNS = 5


def command(*args: str, **options) -> dict[str, float]:
    """Wall and CPU seconds and peak memory of a whole process."""
    clock = time.perf_counter()
    process = subprocess.Popen(args, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, **options)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    assert process.returncode == 0, args
    return {
        "wall": time.perf_counter() - clock,
        "cpu": usage.ru_utime + usage.ru_stime,
        "memory": usage.ru_maxrss / 1024,
    }


def task(name: str, store: Path) -> dict[str, float]:
    done = subprocess.run([sys.executable, HERE / "tasks.py", name, store], capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


def medians(runs: list[dict[str, float]]) -> dict[str, float]:
    return {key: statistics.median(run[key] for run in runs) for key in runs[0]}


def row(what: str, figure: str, aim: str) -> None:
    print(f"| {what} | {figure} | {aim} |", flush=True)


def lifts(work: Path) -> None:
    """How long a lift takes, beside a product of two matrices of 2 000 × 2 000."""
    for name in ("best-eigen", "quick-eigen"):
        made = work / name
        fit = [*KOOP, "fit-eigen", "--experiment", name, "--store", str(made)]
        subprocess.run(fit, check=True, capture_output=True)
        one, many, product = (
            medians([task(what, made) for _ in range(RUNS)])["cpu"] for what in ("lift-one", "lift-many", "dgemm")
        )
        figure = f"{1e3 * one / 200:.2f} = dgemm / {200 * product / one:.0f}"
        for_one, for_many = {"best-eigen": ("≤ 3", "≤ 1.5"), "quick-eigen": ("≤ 0.4", "")}[name]
        row(f"{name}, a lift of one state: CPU ms, and beside 2 000³ dgemm", figure, for_one)
        figure = f"{many:.2f} = dgemm × {many / product:.1f}"
        row(f"{name}, a lift of 2 000 states: CPU s, and beside it", figure, for_many)


ROWS, COLUMNS = 100_000, 20  # of a log
SELECTED = 13_750  # rows that a predictor is chosen on
MAP = """log = {{ dt = {dt} }}
[source.log]
file = "{file}"
time = {{ column = "t", unit = "s" }}
[states]
v_x = {{ source = "log", column = "c1", unit = "m/s" }}
v_y = {{ source = "log", column = "c2", unit = "m/s" }}
yaw_rate = {{ source = "log", column = "c3", unit = "rad/s" }}
[inputs]
steer = {{ source = "log", column = "c4", unit = "rad" }}
pedal = {{ source = "log", column = "c5", unit = "1" }}
"""


def logs(work: Path) -> None:
    """How long a log takes to come in, and a choice on it, beside a product of two matrices of 2 000 × 2 000."""
    product = medians([task("dgemm", work) for _ in range(RUNS)])["cpu"]
    names = {}
    for rows, columns, dt in ((ROWS, COLUMNS, 0.02), (SELECTED, 6, 0.04)):
        t = dt * np.arange(rows)
        table = np.stack([t, *(np.sin((0.3 + 0.1 * i) * t) + 0.1 * np.sin(7 * i * t) for i in range(1, columns))])
        table[1] += 15
        file, header = work / f"log{rows}.csv", ",".join(["t", *(f"c{i}" for i in range(1, columns))])
        np.savetxt(file, table.T, delimiter=",", header=header, comments="", fmt="%.9g")
        (work / f"{rows}.toml").write_text(MAP.format(dt=dt, file=file.name), encoding="utf-8")
        store = ["--store", str(work / "logs")]
        line = [*KOOP, "import", str(file), "--map", str(work / f"{rows}.toml"), *store]
        spent = command(*line)
        names[rows] = subprocess.run(line, check=True, capture_output=True, text=True).stdout.strip()
        figure = f"{spent['cpu']:.2f} = dgemm × {spent['cpu'] / product:.1f}, {spent['memory']:.0f} MB"
        row(f"import of {rows:,} rows × {columns} columns, whole process: CPU s, and beside 2 000³ dgemm", figure, "")
    spent = command(*KOOP, "select", names[SELECTED], "--no-bicycle", *store)
    figure = f"{spent['cpu']:.2f} = dgemm × {spent['cpu'] / product:.1f}"
    row(
        f"select on {SELECTED:,} rows, 3 states, 2 inputs, whole process: CPU s, and beside it",
        figure,
        "≤ 5 + start-up",
    )


def main() -> None:
    work = Path(tempfile.mkdtemp(prefix="koop-bench-"))
    store = work / "store"
    for where, kind in ((store, ["simulate"]), (store / "test", ["simulate", "--set", "sample.kind=box"])):
        subprocess.run([*KOOP, *kind, "--store", str(where)], check=True, capture_output=True)

    print("| what | measured | aim |\n|---|---|---|")
    runs: dict[str, list[dict[str, float]]] = {name: [] for name in ("fit-product", "fit-plain", "fit-blocks")}
    for _ in range(RUNS):
        for name, found in runs.items():
            found.append(task(name, store))
    product, plain, blocks = (medians(runs[name]) for name in runs)
    assert abs(product["result"] / plain["result"] - 1) < 1e-6, "the fits disagree"
    row("order-7 fit, 202 500 samples: CPU s", f"{product['cpu']:.2f}", "")
    row("the same by plain chunked normal equations: CPU s", f"{plain['cpu']:.2f}", "")
    row("ratio", f"1 / {plain['cpu'] / product['cpu']:.1f}", "≤ 1/5")
    row("the same data read in blocks, product unused: CPU s", f"{blocks['cpu']:.2f}", "")

    for fast, slow, what in (
        ("fit-bilinear", "fit-bilinear-blocks", "bilinear fit, 27 functions: CPU s, and the same data read in blocks"),
        ("bilinear-prediction", "bilinear-loop", "its prediction of 3 375 × 30: CPU s, and one trajectory at a time"),
    ):
        pairs = [(task(fast, store), task(slow, store)) for _ in range(RUNS)]
        quick, slowly = (medians([pair[i] for pair in pairs]) for i in range(2))
        assert abs(quick["result"] / slowly["result"] - 1) < 1e-6, f"{fast} and {slow} disagree"
        row(what, f"{quick['cpu']:.2f} / {slowly['cpu']:.2f} = 1 / {slowly['cpu'] / quick['cpu']:.0f}", "")

    fits = []
    for _ in range(RUNS):
        for path in (store / "records" / "fit-edmd").glob("*.json"):
            path.unlink()
        fits.append(command(*KOOP, "fit-edmd", "--store", str(store)))
    row("`koop fit-edmd --order 7`, whole process: MB resident", f"{medians(fits)['memory']:.0f}", "≤ 300")
    row("the same: wall s", f"{medians(fits)['wall']:.2f}", "")

    scores = medians([task("evaluation", store) for _ in range(RUNS)])
    row("evaluation 3 375 × 30, order 7: CPU s", f"{scores['cpu']:.2f}", "≤ 1")

    helps = medians([command(*KOOP, "--help") for _ in range(RUNS)])
    row("`koop --help`: wall s", f"{helps['wall']:.2f}", "≤ 0.25")

    eigen = work / "eigen"
    for what in (["simulate", "--plant", "slips"], ["fit-eigen"]):
        subprocess.run([*KOOP, *what, "--store", str(eigen)], check=True, capture_output=True)
    ball = subprocess.run(
        [*KOOP, "sample", "ball", "--store", str(eigen / "test")], check=True, capture_output=True, text=True
    ).stdout.strip()
    subprocess.run([*KOOP, "simulate", ball, "--store", str(eigen / "test")], check=True, capture_output=True)
    for name, what, aim in (
        ("slips", "441 × 1.5 s on tyres: CPU s", "≤ 2"),
        ("eigen-fit", "eigenfunctions, 4 410 lifted states: CPU s", "≤ 1"),
        ("eigen-evaluation", "their evaluation, 2 000 × 50: CPU s", "≤ .5"),
    ):
        row(what, f"{medians([task(name, eigen) for _ in range(RUNS)])['cpu']:.2f}", aim)
    for fast, slow, what, close in (
        ("walk", "find-simplex", "2 000 queries of `linear`, built: CPU s, and by scipy's find_simplex", 1e-6),
        ("splines", "rbf", "2 000 queries of `polyharmonic`: CPU s, and by scipy's RBFInterpolator", 1e-6),
    ):
        pairs = [(task(fast, eigen), task(slow, eigen)) for _ in range(RUNS)]
        quick, slowly = (medians([pair[i] for pair in pairs]) for i in range(2))
        assert abs(quick["result"] / slowly["result"] - 1) < close, f"{fast} and {slow} disagree"
        row(what, f"{quick['cpu']:.2f} / {slowly['cpu']:.2f} = 1 / {slowly['cpu'] / quick['cpu']:.0f}", "")

    lifts(work)
    logs(work)
    best = [*KOOP, "evaluate", "--experiment", "best-eigen", "--store", str(work / "best")]
    clock = time.perf_counter()
    fit = subprocess.run(
        [*KOOP, "fit-eigen", "--experiment", "best-eigen", "--store", str(work / "best")],
        check=True,
        capture_output=True,
        text=True,
    ).stdout.strip()
    command(*best, fit)
    row("best-eigen and its evaluation, from nothing: wall s", f"{time.perf_counter() - clock:.0f}", "≤ 60")

    fits = [task(name, eigen) for name in ("eigen-fit", "eigen-dense")]
    ratio = fits[1]["cpu"] / fits[0]["cpu"]
    row("the fit against a tenth of its trajectories and splines as one dense least squares", f"1 / {ratio:.0f}", "")

    for method in ("edmd", "eigen"):
        whole = [*KOOP, "reproduce", method, "--store", str(work / method / "whole")]
        cold = command(*whole)
        row(
            f"`koop reproduce {method}`, cold: wall s",
            f"{cold['wall']:.0f}",
            {"edmd": "≤ 300", "eigen": "≤ 90"}[method],
        )
        row("the same: MB resident", f"{cold['memory']:.0f}", "")
        warm = medians([command(*whole) for _ in range(RUNS)])
        row("the same, warm: wall s", f"{warm['wall']:.2f}", "≤ 4")


if __name__ == "__main__":
    main()
