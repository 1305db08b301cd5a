"""Stage ``sample``: initial states and inputs, the only place where a dataset is drawn."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from koopcli.checks import build
from koopcli.config.driving import DriveSample, DriveTestSample, ManoeuvreSample
from koopcli.config.samples import (
    SAMPLED_FOR,
    SAMPLES,
    BallSample,
    BoxSample,
    EllipsoidSample,
    GreedySample,
    GridSample,
    PointSample,
    SampleSettings,
)
from koopcli.errors import InvalidValueError
from koopcli.records import FloatArray, Meta, Sample
from koopcli.simulation import designs, sampling
from koopcli.simulation.integrate import simulate
from koopcli.simulation.manoeuvres import MANOEUVRES, Driver
from koopcli.stages.base import Context, Cost, Inputs, Stage, Task, refuse_beyond_memory
from koopcli.vehicles.handling import understeer_gradient
from koopcli.vehicles.plants import PLANTS
from koopcli.vehicles.single_track import SlipInput, TorqueInput
from koopcli.vehicles.symmetry import images


def _settings(values: Mapping[str, Any]) -> SampleSettings:
    return build(SAMPLES[values["kind"]], values)


def _run(settings: SampleSettings, inputs: Inputs, context: Context) -> Sample:
    plant, s = PLANTS[SAMPLED_FOR[settings.kind]], settings
    n_x, n_u = len(plant.states), len(plant.inputs)
    factors: tuple[FloatArray, ...] = ()
    states, u = np.empty((0, n_x)), np.empty((0, 1, n_u))
    if isinstance(s, GridSample):
        factors, u = sampling.grid(s.seed, s.box, s.count, s.draw, s.levels, s.columns, n_u)
    elif isinstance(s, BoxSample):
        states, u = sampling.box(s.seed, s.box, s.count, s.excitation, s.amplitude, s.steps, n_u, s.layout)
    elif isinstance(s, PointSample):
        states = np.array([s.x0])
        u = sampling.excite(np.random.default_rng(s.seed), s.excitation, s.amplitude, 1, s.steps, n_u)
    elif isinstance(s, (DriveSample, DriveTestSample)):
        assert s.r_w is not None, "checked"
        largest, magnitudes = (s.v_y, s.yaw_rate, s.slip), (s.torque, s.steer, s.steer_rear)
        speeds = (s.slowest, s.fastest)
        states, u = sampling.drive(s.seed, s.count, speeds, largest, s.r_w, s.excitation, magnitudes, s.steps)
    elif isinstance(s, ManoeuvreSample):
        states, u = _manoeuvre(s)
    else:
        states = _inside(s, context)
        u = np.zeros((len(states), 1, n_u))
    return Sample(factors, states, u, bool(factors), plant.states, plant.inputs)


def _manoeuvre(s: ManoeuvreSample) -> tuple[FloatArray, FloatArray]:
    """The first state (1, 5), on wheels that roll, and the inputs (1, steps, 6)."""
    assert s.speed is not None, "settled"
    assert s.vehicle.r_w is not None, "checked"
    driver = Driver(s.vehicle, s.speed, s.scale)
    rate = s.speed / s.vehicle.r_w
    u = MANOEUVRES[s.name].inputs(driver, [k * s.dt for k in range(s.horizon)])
    return np.array([[s.speed, 0.0, 0.0, rate, rate]]), np.array([u])


def _inside(s: EllipsoidSample | GreedySample | BallSample, context: Context) -> FloatArray:
    """States (n, n_x) on Γ or inside."""
    semi_axes = sampling.semi_axes(s.energy, s.m, s.Jzz)
    if isinstance(s, BallSample):
        return sampling.ball(s.seed, s.count) * semi_axes
    if isinstance(s, EllipsoidSample):
        return sampling.shells(sampling.MESHES[s.mesh](s.count), s.shells) * semi_axes
    plant, steps = SlipInput(s.vehicle, s.v_eps), round(s.usable / s.dt)
    u = np.zeros((designs.BATCH, min(s.steps, steps), len(plant.inputs)))

    def flow(x0: FloatArray) -> FloatArray:
        return simulate(plant.rhs, x0, u[: len(x0)], s.dt, fastest_rate=plant.fastest_rate)

    return designs.fill(
        sampling.ball(s.seed, s.candidates) * semi_axes,
        s.count,
        flow,
        steps + 1,
        images(s.mirror, s.vehicle, plant.states.names),
        lambda x: np.asarray(x / semi_axes),
        context.progress,
    )


def _figures(sample: Sample) -> Meta:
    states, rows = sample.starts, len(sample.inputs)
    return {"states": states, "inputs": rows, "trajectories": states * rows if sample.crossed else states}


def _check(task: Task) -> None:
    s = task.settings
    names = PLANTS[SAMPLED_FOR[s.kind]].states.names
    if isinstance(s, (GridSample, BoxSample)) and len(s.box) != len(names):
        raise InvalidValueError(f"'sample.box' must have one half-width for each of {', '.join(names)}, got {s.box}")
    if isinstance(s, BoxSample) and s.layout == "product":
        sampling.values_per_state(s.count, len(s.box))
    if isinstance(s, PointSample) and len(s.x0) != len(names):
        raise InvalidValueError(f"'test.point.x0' must have one value for each of {', '.join(names)}, got {s.x0}")
    if isinstance(s, EllipsoidSample):
        sampling.check_mesh(s.mesh, s.count)
    if isinstance(s, GreedySample):
        _check_greedy(s)
    if isinstance(s, (DriveSample, DriveTestSample)):
        _check_drive(s)
    if isinstance(s, ManoeuvreSample):
        TorqueInput(s.vehicle)
        if not math.isfinite(understeer_gradient(s.vehicle)):
            raise InvalidValueError("no steer turns a car without grip: raise vehicle.mu_scale or lateral.mu above 0")
    refuse_beyond_memory("the sample", _estimate(task).bytes, "sample.count")


def _check_drive(s: DriveSample | DriveTestSample) -> None:
    if s.r_w is None:
        raise InvalidValueError(
            f"a sample of kind '{s.kind}' needs a vehicle with wheels: give the vehicle file their radius r_w"
        )
    if s.slowest > s.fastest:
        raise InvalidValueError(
            f"'sample.slowest' {s.slowest:g} m/s must not be above 'sample.fastest' {s.fastest:g} m/s"
        )


def _check_greedy(s: GreedySample) -> None:
    images(s.mirror, s.vehicle, SlipInput(s.vehicle, s.v_eps).states.names)
    length = s.steps * s.dt
    if s.count < 1:
        raise InvalidValueError(f"'sample.budget' of {s.budget:g} s does not pay for one trajectory of {length:g} s")
    if s.count > s.candidates:
        raise InvalidValueError(
            f"'sample.budget' of {s.budget:g} s pays for {s.count:,} trajectories, more than the states to choose "
            f"from: raise sample.candidates from {s.candidates:,}"
        )
    if s.usable > length:
        raise InvalidValueError(f"'sample.usable' of {s.usable:g} s is longer than trajectories of {length:g} s")


def _estimate(task: Task) -> Cost:
    s = task.settings
    seconds = 0.0
    if isinstance(s, GreedySample):
        trees = s.count / designs.BATCH * (s.candidates + s.count * s.usable / s.dt) * 5e-7
        seconds = trees + s.count * s.candidates * 3e-7 + 1e-5 * s.count * s.steps
    return Cost(seconds + 2e-8 * s.numbers, 8.0 * s.numbers)


STAGE = Stage(
    name="sample",
    version=1,
    settings=_settings,
    run=_run,
    unpack=Sample.unpack,
    figures=_figures,
    describe=lambda f, settings: f"{f['states']} states, {f['inputs']} input rows, {f['trajectories']} trajectories",
    check=_check,
    estimate=_estimate,
)
