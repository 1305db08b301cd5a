"""Stage ``evaluate``: the scores of a predictor on test trajectories, committed chunk by chunk."""

from __future__ import annotations

from koopcli.checks import build
from koopcli.config.settings import Evaluate
from koopcli.errors import InvalidValueError
from koopcli.koopman.evaluation import Evaluation, evaluate, join
from koopcli.records import Meta, Packed
from koopcli.stages.base import Context, Cost, Inputs, Stage, Task


def _run(settings: Evaluate, inputs: Inputs, context: Context) -> Evaluation:
    predictor, trajectories = inputs["predictor"], inputs["trajectories"]

    def score(rows: slice) -> Packed:
        return evaluate(predictor, trajectories, rows, settings.first).pack()

    parts = context.chunks(len(trajectories), settings.chunk, score)
    result = join([Evaluation.unpack(part) for part in parts])
    lost = int(result.diverged.sum())
    if lost:
        context.warn(f"{lost} of {len(result.diverged)} predictions diverged and are left out of the figures")
    return result


def _describe(figures: Meta) -> str:
    score = figures["rmse"]
    return f"RMSE mean {score['mean']:.4g} %, median {score['median']:.4g} %, max {score['max']:.4g} %"


def _check(task: Task) -> None:
    steps = dict(task.inputs)["trajectories"].settings.steps
    if task.settings.first > steps:
        raise InvalidValueError(f"'evaluate.first' must be at most the {steps} steps of the test set")


def _estimate(task: Task) -> Cost:
    test = dict(task.inputs)["trajectories"]
    samples = test.ancestor("sample").settings.trajectories * test.settings.steps
    order = task.ancestor("fit-edmd").settings.order
    return Cost(6e-9 * samples * (order + 1) ** 3, 90.0 * test.ancestor("sample").settings.trajectories)


STAGE = Stage(
    name="evaluate",
    version=1,
    settings=lambda values: build(Evaluate, values),
    run=_run,
    unpack=Evaluation.unpack,
    figures=Evaluation.figures,
    describe=_describe,
    check=_check,
    estimate=_estimate,
)
