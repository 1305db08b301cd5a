"""Stage ``sample``: initial states and inputs, the only place where a dataset is drawn."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from koopcli.checks import build
from koopcli.config.samples import (
    SAMPLED_FOR,
    SAMPLES,
    BallSample,
    BoxSample,
    EllipsoidSample,
    GridSample,
    PointSample,
    SampleSettings,
)
from koopcli.errors import InvalidValueError
from koopcli.records import FloatArray, Meta, Sample
from koopcli.simulation import sampling
from koopcli.stages.base import Context, Cost, Inputs, Stage, Task, refuse_beyond_memory
from koopcli.vehicles.plants import PLANTS


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
    else:
        points = sampling.ball(s.seed, s.count) if isinstance(s, BallSample) else sampling.MESHES[s.mesh](s.count)
        states, u = points * sampling.semi_axes(s.energy, s.m, s.Jzz), np.zeros((s.count, 1, n_u))
    return Sample(factors, states, u, bool(factors), plant.states, plant.inputs)


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
    refuse_beyond_memory("the sample", _estimate(task).bytes, "sample.count")


def _estimate(task: Task) -> Cost:
    return Cost(2e-8 * task.settings.numbers, 8.0 * task.settings.numbers)


STAGE = Stage(
    name="sample",
    version=1,
    settings=_settings,
    run=_run,
    unpack=Sample.unpack,
    figures=_figures,
    describe=lambda f: f"{f['states']} states, {f['inputs']} input rows, {f['trajectories']} trajectories",
    check=_check,
    estimate=_estimate,
)
