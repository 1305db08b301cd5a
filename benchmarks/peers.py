"""``make peers``: the order-7 fit and its prediction by koop, by other EDMD packages and by plain numpy, side by side.

Every competitor does the same work in an environment and a process of its own, on one thread, in turn (A B C A B C …);
medians of RUNS. The table goes to docs/benchmarks.md.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from side_by_side.environments import COMPETITORS, UnavailableError, environment
from side_by_side.report import Results, hardware, notes, ratios, table
from side_by_side.samples import ARRAYS

HERE = Path(__file__).parent
RUNS = 3
DATASETS = {
    "product": [],
    "unstructured": ["sample.kind=box", "sample.count=202500", "sample.steps=1", "sample.amplitude=100"],
}
TEST = ["sample.kind=box"]
ONE_THREAD = {f"{library}_NUM_THREADS": "1" for library in ("OPENBLAS", "OMP", "MKL")}


def simulated(store: Path, settings: list[str]) -> Any:
    """The trajectories that ``koop simulate`` makes with these settings."""
    import koopcli

    told = [part for setting in settings for part in ("--set", setting)]
    subprocess.run(
        [sys.executable, "-m", "koopcli", "simulate", "--store", str(store), *told], check=True, capture_output=True
    )
    return koopcli.load("simulate", store)


def prepare(work: Path) -> None:
    """A folder for each dataset: koop's store, and the same samples and basis for whoever knows numpy alone."""
    from koopcli.koopman.edmd import fit as edmd

    test = simulated(work / "test", TEST)
    for name, settings in DATASETS.items():
        data = simulated(work / name / "store", settings)
        basis = edmd.FitEdmd.of(basis="tensor", order=7).basis_from(data)
        recurrences = {
            f"{key}{i}": a.values[...] for i, axis in enumerate(basis.axes) for key, a in axis.pack().items()
        }
        x, u = np.asarray(data.x), np.asarray(data.u)
        np.savez(
            work / name / ARRAYS,
            x=x[:, 0],
            u=u[:, 0],
            x_next=x[:, 1],
            test_x=np.asarray(test.x),
            test_u=np.asarray(test.u),
            dt=data.dt,
            C=basis.state_map,
            **recurrences,
        )


def process(python: Path | str, *args: str) -> Any:
    """What a script beside this one prints as JSON, run on one thread. Raises ``UnavailableError`` where it fails."""
    done = subprocess.run(
        [python, *args],
        cwd=HERE / "side_by_side",
        env=os.environ | ONE_THREAD,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        last = (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1]
        raise UnavailableError(f"fails: {last[:100]}")
    return json.loads(done.stdout.splitlines()[-1])


def measure(work: Path, folder: Path, runs: int, chosen: list[str]) -> Results:
    """All runs of all competitors, and why some have none."""
    results = Results({name: {each: [] for each in chosen} for name in DATASETS}, {})
    pythons: dict[str, Path | str] = {}
    for each in chosen:
        try:
            package = COMPETITORS[each][2]
            pythons[each] = environment(folder, package) if package else sys.executable
        except UnavailableError as error:
            results.failures[each] = str(error)
    for name, found in results.runs.items():
        for run in range(runs):
            for each in chosen:
                if each in results.failures:
                    continue
                print(f"{name}, run {run + 1} of {runs}: {each}", file=sys.stderr, flush=True)
                try:
                    found[each].append(process(pythons[each], "run_one.py", each, str(work / name)))
                except UnavailableError as error:
                    results.failures[each] = str(error)
    results.dgemm = statistics.median(process(sys.executable, "dgemm.py")["rate"] for _ in range(runs))
    return results


def main() -> None:
    """Make the data and the environments, run everything, print the table, the ratios and the notes."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--environments", type=Path, default=HERE.parent / ".venv-peers", help="where peers are installed"
    )
    parser.add_argument("--runs", type=int, default=RUNS, help="runs of each competitor on each dataset")
    parser.add_argument("--only", nargs="+", choices=COMPETITORS, default=list(COMPETITORS), help="some competitors")
    parser.add_argument("--json", type=Path, help="a file for every number of every run")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="koop-peers-") as work:
        prepare(Path(work))
        results = measure(Path(work), options.environments, options.runs, options.only)
    if options.json:
        options.json.write_text(json.dumps(results.pack(), indent=1) + "\n")
    print(f"{hardware()}; one thread; medians of {options.runs} runs in turn.\n")
    for part in (table(results), ratios(results), notes(results)):
        print(part + "\n")


if __name__ == "__main__":
    main()
