"""Stage ``evaluate``: the scores of a predictor on test trajectories, committed chunk by chunk."""

from __future__ import annotations

from typing import Any

import numpy as np

from koopcli.blocks import blocks
from koopcli.checks import build
from koopcli.config.settings import Evaluate
from koopcli.errors import InvalidValueError
from koopcli.koopman.predictor.predictor import check_horizon
from koopcli.koopman.scores.evaluation import Evaluation, evaluate, join, shortest_prediction
from koopcli.progress import Progress, within
from koopcli.records import Meta, Packed
from koopcli.stages.asked import as_asked, as_fitted, lifts, takes, tested_on
from koopcli.stages.base import Context, Cost, Inputs, Stage, Task, refuse_beyond_memory
from koopcli.stages.fits import outlook
from koopcli.stages.roles import finished
from koopcli.vehicles.plants.slips_axle_forces import driven

SAMPLES = 500_000  # scored together, however long the trajectories of a chunk are


def _run(settings: Evaluate, inputs: Inputs, context: Context) -> Evaluation:
    trajectories = finished(inputs["trajectories"], context)
    predictor = as_asked(inputs["predictor"], settings, trajectories)
    result = join([Evaluation.unpack(part) for part in context.chunks(len(trajectories), settings.chunk)])
    figures, n = result.figures(), len(result.diverged)
    for name, what in (
        ("diverged", "predictions diverged"),
        ("diverged_relift", "re-lifted predictions diverged"),
        ("undefined", "predicted stretches are zero in truth and have no relative error"),
    ):
        if figures[name]:
            context.warn(f"{figures[name]} of {n} {what}; they are left out of the numbers")
    fitted = predictor.functions > 0  # nobody takes a baseline that knows no inputs for more than it is
    if (
        fitted
        and not predictor.knows_inputs
        and any(np.asarray(trajectories.u[rows]).any() for rows in blocks(slice(0, len(trajectories)), settings.chunk))
    ):
        context.warn("the test trajectories have inputs, of which this predictor knows nothing")
    if names := _differing(driven(predictor.plant), driven(trajectories.plant)):
        context.warn(f"the test trajectories are of another vehicle or plant than the predictor: {', '.join(names)}")
    if figures["outside"]:
        context.warn(
            f"{figures['outside']} of {n} test states lie outside the data, the convex hull of the training states: "
            f"predictions from there {getattr(predictor, 'beyond', 'follow the same rule')}"
        )
    return result


def _chunk(settings: Evaluate, inputs: Inputs, rows: slice, progress: Progress) -> Packed:
    trajectories = inputs["trajectories"].finished()
    assert settings.first is not None, "settled from the plant"
    assert settings.relift is not None, "settled from the predictor"
    predictor, parts = as_asked(inputs["predictor"], settings, trajectories), []
    for block in blocks(rows, _together(trajectories.steps)):
        part = within(progress, block.start - rows.start, block.stop - rows.start, rows.stop - rows.start)
        parts.append(evaluate(predictor, trajectories, block, settings.first, settings.restart, settings.relift, part))
    return join(parts).pack()


def _together(steps: int) -> int:
    """How many trajectories are scored at once."""
    return max(1, SAMPLES // steps)


def _differing(a: Meta, b: Meta) -> list[str]:
    """What differs between two plants, by name."""
    if not a or not b:
        return []
    return sorted(name for name in {**a["vehicle"], **a, **b} if _at(a, name) != _at(b, name))


def _at(plant: Meta, name: str) -> Any:
    return None if name == "vehicle" else plant.get(name, plant["vehicle"].get(name))


def _describe(figures: Meta, settings: Evaluate) -> str:
    score = figures["rmse"]
    emptiest = 100 * figures["worst_in_emptiest"]
    bound = figures["bound"]
    trust = f"; {100 * bound['covered']:.1f} % of the errors are within their 90 % bounds" if bound else ""
    return (
        f"RMSE mean {score['mean']:.4g} ± {score['std']:.3g} %, median {score['median']:.4g} %, "
        f"max {score['max']:.4g} %; {emptiest:.0f} % of the worst 5 % of states lie in the emptiest 5 % of the data"
        f"{trust}"
    )


def _check(task: Task) -> None:
    trained, tested = task.input("predictor").find("simulate"), task.input("trajectories").settings.plant
    if trained is not None and not takes(task.input("predictor"), tested):
        mine = tested_on(task.input("predictor"), trained.settings).plant
        assert mine is not None, "settled when it was simulated"
        raise InvalidValueError(
            f"the predictor is of the plant '{mine.kind}', the test trajectories of '{tested.kind}': "
            "they have different states or inputs"
        )
    steps = task.input("trajectories").settings.steps
    restart = task.settings.restart
    check_horizon(min(steps, restart or steps), outlook(as_fitted(task.input("predictor"), task.settings)).horizon)
    shortest = shortest_prediction(steps, restart)
    if task.settings.first > shortest:
        what = "the shortest prediction" if restart else "the test set"
        raise InvalidValueError(f"'evaluate.first' must be at most the {shortest} steps of {what}")
    test = task.input("trajectories").find("sample")
    rows = min(task.settings.chunk, _together(steps))
    if test is not None:
        rows = min(rows, test.settings.trajectories)
    refuse_beyond_memory("a chunk", 24.0 * rows * outlook(task.input("predictor")).functions, "evaluate.chunk")


def _estimate(task: Task) -> Cost:
    test, settings = task.input("trajectories"), task.settings
    n, steps = test.ancestor("sample").settings.trajectories, test.settings.steps
    predictor = as_fitted(task.input("predictor"), settings)
    about, kinds = outlook(predictor), 1 + bool(settings.relift)
    turns = steps * -(-n // min(settings.chunk, _together(steps)))
    seconds = bool(settings.relift) * turns * about.a_step
    seconds += n * (lifts(predictor, steps) + bool(settings.relift) * steps) * about.a_lift
    seconds += n * steps * (6e-9 * (about.functions + 100) + kinds * about.a_state)
    return Cost(seconds, 13e3 + 115.0 * n * -(-steps // (settings.restart or steps)))


STAGE = Stage(
    name="evaluate",
    version=6,
    settings=lambda values: build(Evaluate, values),
    run=_run,
    unpack=Evaluation.unpack,
    figures=Evaluation.figures,
    describe=_describe,
    check=_check,
    estimate=_estimate,
    chunk=_chunk,
)
