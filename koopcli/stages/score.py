"""Stage ``score``: how well a predictor does on a log."""

from __future__ import annotations

from dataclasses import dataclass

from koopcli.checks import build
from koopcli.koopman.selection.score import Score, score
from koopcli.records import Meta
from koopcli.stages.base import Context, Cost, Inputs, Stage


@dataclass(frozen=True)
class OnLog:
    """A score on a log; ``own``: whether the predictor was fitted to it."""

    own: bool = False


def _run(settings: OnLog, inputs: Inputs, context: Context) -> Score:
    episodes = inputs["trajectories"].episodes
    return score(inputs["predictor"], inputs["dmdc"], episodes, own=settings.own, progress=context.progress)


def _describe(figures: Meta, settings: OnLog) -> str:
    errors = ", ".join(f"{name} {about['0.5']['rmse']:.3g}" for name, about in figures["per_state"].items())
    return (
        f"{figures['windows']} windows; RMSE after 0.5 s: {errors}; {figures['rmse']['mean']:.3g} % of the state's size"
    )


STAGE = Stage(
    name="score",
    version=1,
    settings=lambda values: build(OnLog, values),
    run=_run,
    unpack=Score.unpack,
    figures=Score.figures,
    describe=_describe,
    check=lambda task: None,
    estimate=lambda task: Cost(1.0, 1e5),
)
