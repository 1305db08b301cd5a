"""Stage ``plot``: a figure, as the numbers it draws and the rendered image."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from koopcli.checks import build
from koopcli.config.settings import Plot, Series
from koopcli.errors import InvalidValueError
from koopcli.figures.drawing import Drawing
from koopcli.koopman.evaluation import Evaluation
from koopcli.records import Meta
from koopcli.stages.base import Context, Cost, Inputs, Stage, Task

if TYPE_CHECKING:
    from koopcli.figures.orders import OrderErrors


def _run(settings: Plot, inputs: Inputs, context: Context) -> Drawing:
    from koopcli.figures.registry import FIGURES  # matplotlib only when something is drawn

    return FIGURES[settings.figure].draw(_curves(settings, inputs), settings.format)


def _curves(settings: Plot, inputs: Inputs) -> list[OrderErrors]:
    """Evaluations grouped by training draw and test inputs, each group by rising order."""
    from koopcli.figures.orders import OrderErrors

    groups: dict[tuple[str, str], list[tuple[int, Evaluation]]] = {}
    for i, one in enumerate(settings.series):
        groups.setdefault((one.draw, one.excitation), []).append((one.order, inputs[str(i)]))
    curves = []
    for (draw, excitation), members in groups.items():
        ordered = sorted(members, key=lambda member: member[0])
        scores = [evaluation.figures()["rmse"] for _, evaluation in ordered]
        curves.append(
            OrderErrors(
                draw=draw,
                excitation=excitation,
                order=np.array([order for order, _ in ordered]),
                mean=np.array([score["mean"] for score in scores]),
                median=np.array([score["median"] for score in scores]),
                maximum=np.array([score["max"] for score in scores]),
            )
        )
    return curves


def _figures(drawing: Drawing) -> Meta:
    return {"figure": drawing.figure, "format": drawing.format, "bytes": len(drawing.image)}


def _check(task: Task) -> None:
    if not task.inputs:
        raise InvalidValueError(f"the figure '{task.settings.figure}' needs at least one evaluation")


STAGE = Stage(
    name="plot",
    version=1,
    settings=lambda values: build(Plot, {**values, "series": tuple(Series(**s) for s in values["series"])}),
    run=_run,
    unpack=Drawing.unpack,
    figures=_figures,
    describe=lambda f: f"{f['figure']}, {f['format']}, {f['bytes']} bytes",
    check=_check,
    estimate=lambda task: Cost(1.0, 1e5),
)
