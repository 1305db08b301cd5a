"""Stage ``evaluate``: the scores of a predictor on test trajectories, committed chunk by chunk."""

from __future__ import annotations

from koopcli.checks import build
from koopcli.config.settings import Evaluate
from koopcli.errors import InvalidValueError
from koopcli.koopman.evaluation import Evaluation, evaluate, join
from koopcli.records import Meta, Packed
from koopcli.stages.base import Context, Cost, Inputs, Stage, Task, refuse_beyond_memory
from koopcli.stages.fit_edmd import functions


def _run(settings: Evaluate, inputs: Inputs, context: Context) -> Evaluation:
    predictor, trajectories = inputs["predictor"], inputs["trajectories"]

    def score(rows: slice) -> Packed:
        return evaluate(predictor, trajectories, rows, settings.first).pack()

    parts = context.chunks(len(trajectories), settings.chunk, score)
    result = join([Evaluation.unpack(part) for part in parts])
    figures, n = result.figures(), len(result.diverged)
    for name, what in (
        ("diverged", "predictions diverged"),
        ("diverged_relift", "re-lifted predictions diverged"),
        ("undefined", "true trajectories are zero and have no relative error"),
    ):
        if figures[name]:
            context.warn(f"{figures[name]} of {n} {what}; they are left out of the figures")
    return result


def _describe(figures: Meta) -> str:
    score = figures["rmse"]
    return f"RMSE mean {score['mean']:.4g} %, median {score['median']:.4g} %, max {score['max']:.4g} %"


def _check(task: Task) -> None:
    steps = task.input("trajectories").settings.steps
    if task.settings.first > steps:
        raise InvalidValueError(f"'evaluate.first' must be at most the {steps} steps of the test set")
    test = task.input("trajectories").find("sample")
    rows = min(task.settings.chunk, test.settings.trajectories) if test is not None else task.settings.chunk
    refuse_beyond_memory("a chunk", 24.0 * rows * functions(task.input("predictor")), "evaluate.chunk")


def _estimate(task: Task) -> Cost:
    test, predictor = task.input("trajectories"), task.input("predictor")
    samples = test.ancestor("sample").settings.trajectories * test.settings.steps
    return Cost(6e-9 * samples * functions(predictor), 90.0 * test.ancestor("sample").settings.trajectories)


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
