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
from koopcli.stages.base import Context, Cost, Inputs, Stage, Task
from koopcli.vehicles.single_track import ForceInput


def _settings(values: Mapping[str, Any]) -> GridSample | BoxSample:
    return build(SAMPLES[values["kind"]], values)


def _run(settings: GridSample | BoxSample, inputs: Inputs, context: Context) -> Sample:
    states, n_u = ForceInput.states, len(ForceInput.inputs)
    s = settings
    if isinstance(s, GridSample):
        factors, u = sampling.grid(s.seed, s.box, s.count, s.draw, s.levels, s.columns, n_u)
        return Sample(factors, np.empty((0, len(states))), u, True, states, ForceInput.inputs)
    x0, u = sampling.box(s.seed, s.box, s.count, s.excitation, s.amplitude, s.steps, n_u)
    return Sample((), x0, u, False, states, ForceInput.inputs)


def _figures(sample: Sample) -> Meta:
    states = len(sample.x0)
    return {
        "states": states,
        "inputs": len(sample.inputs),
        "trajectories": states * (sample.product or (1, 1))[1],
    }


def _check(task: Task) -> None:
    if len(task.settings.box) != len(ForceInput.states):
        names = ", ".join(ForceInput.states.names)
        raise InvalidValueError(f"'sample.box' must have one half-width for each of {names}, got {task.settings.box}")


def _estimate(task: Task) -> Cost:
    s = task.settings
    rows = len(s.levels) * s.columns if isinstance(s, GridSample) else s.count * (3 / 4 + s.steps)
    return Cost(1e-7 * rows, 32.0 * rows)


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
