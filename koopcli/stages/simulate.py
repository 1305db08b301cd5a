"""Stage ``simulate``: trajectories of a plant from a sample."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np

from koopcli.checks import build
from koopcli.config.samples import SAMPLED_FOR
from koopcli.config.settings import Simulate
from koopcli.errors import InvalidValueError
from koopcli.records import Meta, Sample, Trajectories
from koopcli.simulation.integrate import simulate
from koopcli.stages.base import Context, Cost, Inputs, Stage, Task, refuse_beyond_memory
from koopcli.vehicles.plants import PLANTS, Plant, make_plant


def _run(settings: Simulate, inputs: Inputs, context: Context) -> Trajectories:
    sample: Sample = inputs["sample"]
    assert settings.steps is not None
    assert settings.plant is not None
    plant = _plant(settings)
    x0, u = sample.expand(settings.steps)
    with np.errstate(over="ignore", invalid="ignore"):
        x = simulate(plant.rhs, x0, u, settings.dt, context.progress, plant.fastest_rate)
    lost = ~np.isfinite(x).all(axis=(1, 2))
    if lost.any():
        raise InvalidValueError(
            f"{lost.sum()} of {len(x)} simulated trajectories leave the finite numbers, the first is number "
            f"{int(lost.argmax())}: lower simulate.dt, the steps or the input amplitude"
        )
    about = {name: getattr(settings, name) for name in ("plant", "force_per", "v_eps")}
    about["vehicle"] = asdict(settings.vehicle)
    return Trajectories(x, u, settings.dt, plant.states, plant.inputs, sample.product, about)


def _figures(trajectories: Trajectories) -> Meta:
    product = trajectories.product
    return {
        "trajectories": len(trajectories),
        "steps": trajectories.steps,
        "dt": trajectories.dt,
        "product": list(product) if product else None,
    }


def _plant(settings: Simulate) -> Plant:
    assert settings.plant is not None, "settled from the sample"
    return make_plant(settings.plant, settings.vehicle, settings.force_per, settings.v_eps)


def _check(task: Task) -> None:
    sample, steps, plant = task.ancestor("sample").settings, task.settings.steps, task.settings.plant
    meant = SAMPLED_FOR[sample.kind]
    if PLANTS[plant].inputs != PLANTS[meant].inputs:
        kinds = [kind for kind, name in SAMPLED_FOR.items() if name == plant]
        raise InvalidValueError(
            f"a sample of kind '{sample.kind}' holds the inputs of the plant '{meant}', not of '{plant}': "
            f"use a sample of kind {' or '.join(kinds)}"
        )
    _plant(task.settings)
    if sample.input_steps is not None and steps > sample.input_steps:
        raise InvalidValueError(
            f"the sample holds fresh inputs for {sample.input_steps} steps, 'simulate.steps' is {steps}: "
            "sample again with more --steps"
        )
    refuse_beyond_memory("the trajectories", _estimate(task).bytes, "the count or the steps")


def _estimate(task: Task) -> Cost:
    n, steps = task.ancestor("sample").settings.trajectories, task.settings.steps
    each = 3e-7 if task.settings.plant == "forces" else 1e-5 * max(1.0, task.settings.dt / 0.01)  # s, with substeps
    return Cost(each * n * steps, 8.0 * n * (3 * (steps + 1) + 4 * steps))


STAGE = Stage(
    name="simulate",
    version=2,
    settings=lambda values: build(Simulate, values),
    run=_run,
    unpack=Trajectories.unpack,
    figures=_figures,
    describe=lambda f: f"{f['trajectories']} trajectories × {f['steps']} steps of {f['dt']} s",
    check=_check,
    estimate=_estimate,
)
