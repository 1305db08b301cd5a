"""One competitor on one dataset in a process of its own: ``python run_one.py COMPETITOR FOLDER`` prints its figures as
JSON. Its environment needs numpy and the competitor alone.
"""

from __future__ import annotations

import gc
import importlib
import json
import platform
import sys
import time
import warnings
from importlib.metadata import version
from pathlib import Path

import numpy as np

sys.path.append(str(Path(__file__).parents[1]))  # benchmarks/plain.py

from competitor import Competitor, rolled
from environments import COMPETITORS
from samples import Samples

FEW, PATIENCE = 100, 60.0  # trajectories that are timed where all would take more than so many seconds


def status(key: str) -> float:
    """A figure of /proc/self/status in MB."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith(f"{key}:")) / 1024


def errors(found: np.ndarray, true: np.ndarray) -> dict[str, float]:
    """Means over trajectories of the error of one step and of all steps in percent."""
    figures = {}
    for name, steps in (("one_step", slice(1, 2)), ("all_steps", slice(1, None))):
        miss, size = (np.sqrt((v[:, steps] ** 2).sum(axis=(1, 2))) for v in (found - true, true))
        figures[f"error_{name}"] = float(np.mean(100 * miss / size))
    return figures


def prediction(competitor: Competitor) -> dict[str, float]:
    """CPU seconds for the test set by its own call, and the errors; of a call for each trajectory maybe scaled up."""
    s = competitor.samples
    x0, u, figures = s.test_x[:, 0], s.test_u, {"timed": len(s.test_x), "scaled": False}
    if competitor.alone:
        begin = time.process_time()
        competitor.predict(x0[:FEW], u[:FEW])
        figures["predict"] = (time.process_time() - begin) * len(x0) / FEW
    if figures.get("predict", 0.0) > PATIENCE:
        A, B = competitor.operator()
        figures |= {"timed": FEW, "scaled": True}
        return figures | errors(rolled(lambda z, now: z @ A.T + now @ B.T, s.basis(x0), u, s.basis.C), s.test_x)
    begin = time.process_time()
    found = competitor.predict(x0, u)
    figures["predict"] = time.process_time() - begin
    return figures | errors(found, s.test_x)


def main(name: str, folder: Path) -> dict:
    """Lift, fit and predict, measured."""
    module, kind, _ = COMPETITORS[name]
    competitor: Competitor = getattr(importlib.import_module(module), kind)(Samples.read(folder))
    square = np.ones((600, 600))
    square @ square  # BLAS has its buffers
    basis = competitor.samples.basis

    gc.collect()
    Path("/proc/self/clear_refs").write_text("5")
    before, begin = status("VmRSS"), time.process_time()
    competitor.lift()
    lifted, basis.seconds = time.process_time(), 0.0
    competitor.fit()
    end, peak = time.process_time(), status("VmHWM")
    competitor.rows = None

    return {
        "fit": end - lifted - basis.seconds,
        "fit_and_lifting": end - begin,
        "growth": peak - before,
        **prediction(competitor),
        "how": competitor.how,
        "versions": {"python": platform.python_version(), **{each: version(each) for each in competitor.packages}},
    }


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    print(json.dumps(main(sys.argv[1], Path(sys.argv[2]))))
