"""Stage ``sample``: initial states and inputs, the only place where anything is drawn."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from koopcli.checks import build
from koopcli.config.settings import SAMPLES, BoxSample, GridSample
from koopcli.errors import InvalidValueError
from koopcli.records import Meta, Sample
from koopcli.simulation import sampling
from koopcli.stages.base import Context, Cost, Inputs, Stage, Task, refuse_beyond_memory
from koopcli.vehicles.plants import PLANTS, SAMPLED_FOR


def _settings(values: Mapping[str, Any]) -> GridSample | BoxSample:
    return build(SAMPLES[values["kind"]], values)


def _run(settings: GridSample | BoxSample, inputs: Inputs, context: Context) -> Sample:
    plant, s = PLANTS[SAMPLED_FOR[settings.kind]], settings
    n_u = len(plant.inputs)
    factors: tuple[Any, ...] = ()
    states = np.empty((0, len(plant.states)))
    if isinstance(s, GridSample):
        factors, u = sampling.grid(s.seed, s.box, s.count, s.draw, s.levels, s.columns, n_u)
    else:
        states, u = sampling.box(s.seed, s.box, s.count, s.excitation, s.amplitude, s.steps, n_u)
    return Sample(factors, states, u, bool(factors), plant.states, plant.inputs)


def _figures(sample: Sample) -> Meta:
    states, rows = sample.starts, len(sample.inputs)
    return {"states": states, "inputs": rows, "trajectories": states * rows if sample.crossed else states}


def _check(task: Task) -> None:
    names = PLANTS[SAMPLED_FOR[task.settings.kind]].states.names
    if len(task.settings.box) != len(names):
        raise InvalidValueError(
            f"'sample.box' must have one half-width for each of {', '.join(names)}, got {task.settings.box}"
        )
    refuse_beyond_memory("the sample", _estimate(task).bytes, "sample.count")


def _estimate(task: Task) -> Cost:
    s = task.settings
    if isinstance(s, GridSample):
        numbers = s.count * len(s.box) + 4 * len(s.levels) * s.columns
    else:
        numbers = s.count * (len(s.box) + 4 * (s.steps if s.excitation == "fresh" else 1))
    return Cost(2e-8 * numbers, 8.0 * numbers)


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
