"""Every stage on toy inputs that no other stage made, and what came out when its version was last raised.

``python -m tests.stages.toys`` rewrites the pins; do so only together with a new version of each stage whose
result moved.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from koopcli.checks import build
from koopcli.config.settings import BoxSample, Evaluate, FitEdmd, GridSample, Plot, Series, Simulate
from koopcli.koopman.bases import TensorPolynomial
from koopcli.koopman.evaluation import Evaluation
from koopcli.koopman.orthonormal import OrthonormalPolynomials
from koopcli.koopman.predictor import Predictor
from koopcli.progress import silent
from koopcli.records import Sample, Trajectories
from koopcli.stages.base import Context
from koopcli.stages.registry import STAGES
from koopcli.vehicles.parameters import VehicleParameters
from koopcli.vehicles.single_track import ForceInput

PINS = Path(__file__).parents[1] / "golden" / "stages.json"
BEYOND = 1e12  # a condition number past this is rounding
TOLERANCE = 1e-6  # above what BLAS threads and processors change, below what any change of a method does
CAR = VehicleParameters(m=1200.0, Jzz=1500.0, l_f=1.2, l_r=1.5, c_w=0.3, A=2.0, rho=1.2)
STATES, INPUTS = ForceInput.states, ForceInput.inputs


def _sample() -> Sample:
    factors = tuple(np.array([-1.0, 0.2, 0.7, 1.3]) * half_width for half_width in (20, 15, 5))
    u = 100 * np.sin(np.arange(24.0) ** 2).reshape(6, 1, 4)
    return Sample(factors, np.empty((0, 3)), u, True, STATES, INPUTS)


def _trajectories(steps: int) -> Trajectories:
    x0, u = _sample().expand(steps)
    decay = np.exp(-0.1 * np.arange(steps + 1))[:, np.newaxis]
    x = x0[:, np.newaxis] * decay + 0.01 * np.sin(x0[:, np.newaxis, ::-1] * (1 - decay))
    x[:, 1:, :3] += 1e-3 * np.cumsum(u, axis=1)[:, :, :3]
    return Trajectories(x, u, 0.01, STATES, INPUTS, _sample().product)


def _flat() -> Trajectories:
    """Data whose inputs are dependent and whose states lie almost in a plane: the QR path, with a dropped direction."""
    full = _trajectories(2)
    x = np.array(full.x)
    x[:, :, 1] = 0.5 * x[:, :, 0] + 1e-4 * np.sin(x[:, :, 0])
    return Trajectories(x, np.repeat(full.u[:, :, :1], 4, axis=2), 0.01, STATES, INPUTS)


def _predictor(growth: float = 0.95) -> Predictor:
    axis = OrthonormalPolynomials(0.5, 20.0, np.array([0.1]), np.array([1.0, 0.6]))
    basis = TensorPolynomial((axis, axis, axis))
    A = growth * np.eye(8) + 0.01 * np.cos(np.arange(64.0)).reshape(8, 8)
    B = 1e-4 * np.sin(np.arange(32.0)).reshape(8, 4)
    domain = np.array([[-20.0, -20, -20], [30, 30, 30]])
    return Predictor(basis, A, B, basis.state_map, 0.01, domain, STATES, INPUTS, 12, 1.0, 1.0)


def _evaluation() -> Evaluation:
    t = np.arange(10.0)
    return Evaluation(
        np.outer(t, [1.0, 2, 3]), t, t, t, np.outer(t, [1.0, 2, 3]), t / 10, t > 8, t > 7, 5, 1, 8, STATES
    )


def _chunks(count, size, compute):
    return [compute(slice(start, min(start + size, count))) for start in range(0, count, size)]


TOYS = {
    "sample": [
        (GridSample(seed=3, count=4, columns=2), {}),
        (GridSample(seed=3, count=4, columns=2, draw="even"), {}),
        (BoxSample(count=5, steps=3), {}),
        (BoxSample(count=5, excitation="held"), {}),
    ],
    "simulate": [
        (Simulate(vehicle=CAR, steps=3), {"sample": _sample()}),
        (Simulate(vehicle=CAR, steps=2, force_per="wheel", dt=0.02), {"sample": _sample()}),
    ],
    "fit-edmd": [
        (FitEdmd(order=2), {"trajectories": _trajectories(1)}),
        (FitEdmd(order=2), {"trajectories": _trajectories(3)}),
        (FitEdmd(order=1), {"trajectories": _flat()}),
    ],
    "evaluate": [
        (Evaluate(chunk=100), {"predictor": _predictor(), "trajectories": _trajectories(4)}),
        (Evaluate(chunk=100), {"predictor": _predictor(growth=250.0), "trajectories": _trajectories(4)}),
    ],
    "plot": [
        (
            build(Plot, {"figure": "orders", "format": "png", "series": (Series(3, "a", "none"),), "drawn_by": ""}),
            {"0": _evaluation()},
        )
    ],
}


def results(stage: str) -> dict[str, list[float]]:
    """Size, sum and weighted sum of every array the stage makes of its toys, and its figures; no image bytes."""
    found = {}
    for i, (settings, inputs) in enumerate(TOYS[stage]):
        made = STAGES[stage].run(settings, inputs, Context(silent, lambda text: None, _chunks))
        for name, array in made.pack().arrays.items():
            if name != "image":
                values = np.asarray(array.values, dtype=float).ravel()
                weights = np.cos(np.arange(len(values)))
                values = np.nan_to_num(values, nan=-1.0, posinf=1e300, neginf=-1e300)
                found[f"{i}/{name}"] = [len(values), float(values.sum()), float(values @ weights)]
        for name, fact in STAGES[stage].figures(made).items():
            if isinstance(fact, (int, float)) and name != "bytes":
                found[f"{i}: {name}"] = [float(min(fact, BEYOND)) if np.isfinite(fact) else BEYOND]
    return found


def complaint(stage: str, pins: dict[str, dict]) -> str | None:
    """What is wrong between a stage, its version and its pinned result; None when nothing is."""
    pin, now = pins.get(stage), results(stage)
    if pin is None:
        return f"{stage} has no pinned result: run python -m tests.stages.toys"
    same = pin["results"].keys() == now.keys() and all(
        np.allclose(now[name], pinned, rtol=TOLERANCE, atol=TOLERANCE * max(1e-3, min(1.0, max(map(abs, pinned)))))
        for name, pinned in pin["results"].items()
    )
    if STAGES[stage].version == pin["version"]:
        return None if same else f"the result of {stage} changed: raise its version, then pin it afresh"
    return f"{stage} has version {STAGES[stage].version}, pinned {pin['version']}: run python -m tests.stages.toys"


def write_pins() -> None:
    """Pin every stage's results beside its version."""
    pins = {stage: {"version": STAGES[stage].version, "results": results(stage)} for stage in TOYS}
    PINS.write_text(json.dumps(pins, indent=1) + "\n")


if __name__ == "__main__":
    write_pins()
