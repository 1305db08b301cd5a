"""Stage ``simulate``: trajectories of a plant from a sample."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np

from koopcli.checks import build
from koopcli.config.settings import BoxSample, Simulate
from koopcli.errors import InvalidValueError
from koopcli.records import Meta, Sample, Trajectories
from koopcli.simulation.integrate import simulate
from koopcli.stages.base import Context, Cost, Inputs, Stage, Task, refuse_beyond_memory
from koopcli.vehicles.plants import PLANTS, WHEELS_PER_FORCE


def _run(settings: Simulate, inputs: Inputs, context: Context) -> Trajectories:
    sample: Sample = inputs["sample"]
    assert settings.steps is not None
    plant = PLANTS[settings.plant](settings.vehicle, WHEELS_PER_FORCE[settings.force_per])
    x0, u = sample.expand(settings.steps)
    with np.errstate(over="ignore", invalid="ignore"):
        x = simulate(plant.rhs, x0, u, settings.dt, context.progress)
    lost = ~np.isfinite(x).all(axis=(1, 2))
    if lost.any():
        raise InvalidValueError(
            f"{lost.sum()} of {len(x)} simulated trajectories leave the finite numbers, the first is number "
            f"{int(lost.argmax())}: lower simulate.dt, the steps or the input amplitude"
        )
    about = {"plant": settings.plant, "force_per": settings.force_per, "vehicle": asdict(settings.vehicle)}
    return Trajectories(x, u, settings.dt, plant.states, plant.inputs, sample.product, about)


def _figures(trajectories: Trajectories) -> Meta:
    product = trajectories.product
    return {
        "trajectories": len(trajectories),
        "steps": trajectories.steps,
        "dt": trajectories.dt,
        "product": list(product) if product else None,
    }


def _check(task: Task) -> None:
    sample, steps = task.ancestor("sample").settings, task.settings.steps
    if isinstance(sample, BoxSample) and sample.excitation == "fresh" and steps > sample.steps:
        raise InvalidValueError(
            f"the sample holds fresh inputs for {sample.steps} steps, 'simulate.steps' is {steps}: "
            "sample again with more --steps"
        )
    refuse_beyond_memory("the trajectories", _estimate(task).bytes, "the count or the steps")


def _estimate(task: Task) -> Cost:
    n, steps = task.ancestor("sample").settings.trajectories, task.settings.steps
    return Cost(3e-7 * n * steps, 8.0 * n * (3 * (steps + 1) + 4 * steps))


STAGE = Stage(
    name="simulate",
    version=1,
    settings=lambda values: build(Simulate, values),
    run=_run,
    unpack=Trajectories.unpack,
    figures=_figures,
    describe=lambda f: f"{f['trajectories']} trajectories × {f['steps']} steps of {f['dt']} s",
    check=_check,
    estimate=_estimate,
)
