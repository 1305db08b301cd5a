"""One measured task in a process of its own: ``python benchmarks/tasks.py TASK STORE`` prints its figures as JSON.

CPU seconds are of the work alone, without imports and reading; the memory is the peak of the whole process.
"""

from __future__ import annotations

import json
import resource
import sys
import time
from pathlib import Path

import numpy as np
import plain

import koopcli
from koopcli.koopman import edmd
from koopcli.koopman.evaluation import evaluate, join

ORDER = 7


def cpu() -> float:
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


def fit_product(store: Path):
    data = koopcli.load("simulate", store)
    yield
    basis = edmd.basis_from_data(data, "tensor", ORDER)
    predictor = edmd.fit(data, basis)
    yield float(np.abs(predictor.A).sum())


def fit_blocks(store: Path):
    from dataclasses import replace

    data = replace(koopcli.load("simulate", store), product=None)
    yield
    basis = edmd.basis_from_data(data, "tensor", ORDER)
    predictor = edmd.fit(data, basis)
    yield float(np.abs(predictor.A).sum())


def fit_plain(store: Path):
    data = koopcli.load("simulate", store)
    basis = edmd.basis_from_data(data, "tensor", ORDER)
    x, u = data.x[:], data.u[:]
    yield
    A, _ = plain.fit(x[:, 0], u[:, 0], x[:, 1], basis.lift)
    yield float(np.abs(A).sum())


def evaluation(store: Path):
    predictor, test = koopcli.load("fit-edmd", store), koopcli.load("simulate", store / "test")
    yield
    parts = [evaluate(predictor, test, slice(i, i + 2048), 1) for i in range(0, len(test), 2048)]
    yield join(parts).figures()["rmse"]["mean"]


TASKS = {"fit-product": fit_product, "fit-blocks": fit_blocks, "fit-plain": fit_plain, "evaluation": evaluation}


if __name__ == "__main__":
    steps = TASKS[sys.argv[1]](Path(sys.argv[2]))
    next(steps)
    begin, clock = cpu(), time.perf_counter()
    result = next(steps)
    figures = {
        "cpu": cpu() - begin,
        "wall": time.perf_counter() - clock,
        "memory": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        "result": result,
    }
    print(json.dumps(figures))
