"""Stage ``baseline``: a prediction that fits nothing, set beside predictors of the same trajectories."""

from __future__ import annotations

from koopcli.checks import build
from koopcli.config.settings import Baseline
from koopcli.koopman.baselines import Forecast
from koopcli.koopman.edmd import coverage
from koopcli.stages.base import Context, Cost, Inputs, Prospect, Stage, Task
from koopcli.stages.usable import finished

NAMES = {
    "hold": "hold the first state",
    "rotation": "rotation at the first yaw rate",
    "linearisation": "linearisation at the first state",
}


def _run(settings: Baseline, inputs: Inputs, context: Context) -> Forecast:
    t = finished(inputs["trajectories"], context)
    return Forecast(settings.kind, t.dt, coverage(t), t.state_channels, t.input_channels, t.plant)


def _prospect(task: Task) -> Prospect:
    kind = task.settings.kind
    if kind == "linearisation":  # a Jacobian of the plant by differences, at every state
        return Prospect(0, None, NAMES[kind], a_step=3e-3, a_state=1e-5)
    return Prospect(0, None, NAMES[kind], a_step=5e-5)


STAGE = Stage(
    name="baseline",
    version=1,
    settings=lambda values: build(Baseline, values),
    run=_run,
    unpack=Forecast.unpack,
    figures=lambda forecast: {"kind": forecast.kind, "functions": forecast.functions},
    describe=lambda f: f"{f['kind']}, fits nothing",
    check=lambda task: None,
    estimate=lambda task: Cost(0.1, 2e6),
    predicts=_prospect,
)
