"""Stage ``sweep``: the scores of many evaluations on a grid of settings, side by side."""

from __future__ import annotations

from koopcli.checks import build
from koopcli.config.settings import Sweep
from koopcli.koopman.scores.evaluation import Evaluation
from koopcli.koopman.scores.swept import Swept, swept
from koopcli.records import Meta
from koopcli.stages.base import Context, Cost, Inputs, Stage


def _run(settings: Sweep, inputs: Inputs, context: Context) -> Swept:
    figures = [inputs[f"{i}/evaluation"] for i in range(len(settings.places))]
    return swept(
        [axis.name for axis in settings.axes], [axis.values for axis in settings.axes], settings.places, figures
    )


def _describe(figures: Meta, settings: Sweep) -> str:
    axes = ", ".join(f"{name} ({len(values)})" for name, values in figures["axes"].items())
    best = figures["best"]
    if best is None:
        return f"{figures['cells']} cells over {axes}; every prediction of all of them diverged"
    told = " ".join(f"{name}={value}" for name, value in best["settings"].items())
    return f"{figures['cells']} cells over {axes}; the best, {told}, has {best['mean']:.4g} %"


def _keep(evaluation: Evaluation) -> Meta:
    """Its numbers: of thousands of evaluations the trajectories would fill the memory."""
    return evaluation.figures()


STAGE = Stage(
    name="sweep",
    version=1,
    settings=lambda values: build(Sweep, values),
    run=_run,
    unpack=Swept.unpack,
    figures=Swept.figures,
    describe=_describe,
    check=lambda task: None,
    estimate=lambda task: Cost(1e-3 * len(task.inputs), 120.0 * len(task.inputs)),
    keep=_keep,
)
