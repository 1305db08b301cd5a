"""Stage ``plot``: a figure, as the numbers it draws and the rendered image."""

from __future__ import annotations

from koopcli.checks import build
from koopcli.config.settings import Plot, Series
from koopcli.errors import InvalidValueError
from koopcli.figures.drawing import Drawing
from koopcli.figures.registry import FIGURES
from koopcli.records import Meta
from koopcli.stages.base import Context, Cost, Inputs, Stage, Task


def _run(settings: Plot, inputs: Inputs, context: Context) -> Drawing:
    return FIGURES[settings.figure].draw(settings.series, inputs, settings.format)


def _figures(drawing: Drawing) -> Meta:
    return {"figure": drawing.figure, "format": drawing.format, "bytes": len(drawing.image)}


def _check(task: Task) -> None:
    if not task.inputs:
        raise InvalidValueError(f"the figure '{task.settings.figure}' needs at least one evaluation")


STAGE = Stage(
    name="plot",
    version=2,
    settings=lambda values: build(Plot, {**values, "series": tuple(Series(**s) for s in values["series"])}),
    run=_run,
    unpack=Drawing.unpack,
    figures=_figures,
    describe=lambda f: f"{f['figure']}, {f['format']}, {f['bytes']} bytes",
    check=_check,
    estimate=lambda task: Cost(1.0, 1e5),
)
