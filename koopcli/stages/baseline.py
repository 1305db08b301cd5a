"""Stage ``baseline``: a prediction without any fit, to compare predictors of the same trajectories with."""

from __future__ import annotations

from koopcli.checks import build
from koopcli.config.settings import Baseline
from koopcli.koopman.edmd.fit import coverage
from koopcli.koopman.scores.baselines import Forecast
from koopcli.stages.base import Context, Cost, Inputs, Outlook, Stage, Task
from koopcli.stages.roles import finished

NAMES = {
    "hold": "hold the first state",
    "rotation": "rotation at the first yaw rate",
    "linearisation": "linearisation at the first state",
}


def _run(settings: Baseline, inputs: Inputs, context: Context) -> Forecast:
    t = finished(inputs["trajectories"], context)
    return Forecast(settings.kind, t.dt, coverage(t), t.state_channels, t.input_channels, t.plant)


def _outlook(task: Task) -> Outlook:
    kind = task.settings.kind
    if kind == "linearisation":  # a Jacobian of the plant by differences, at every state
        return Outlook(0, None, NAMES[kind], a_step=3e-3, a_state=1e-5)
    return Outlook(0, None, NAMES[kind], a_step=5e-5)


STAGE = Stage(
    name="baseline",
    version=1,
    settings=lambda values: build(Baseline, values),
    run=_run,
    unpack=Forecast.unpack,
    figures=lambda forecast: {"kind": forecast.kind, "functions": forecast.functions},
    describe=lambda f, settings: f"{NAMES[f['kind']]}, a baseline without any fit",
    check=lambda task: None,
    estimate=lambda task: Cost(0.1, 2e6),
    predicts=_outlook,
)
