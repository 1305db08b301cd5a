"""Stage ``plot``: a figure, as the numbers it draws and the rendered image."""

from __future__ import annotations

from koopcli import __version__
from koopcli.checks import build
from koopcli.config.pictures import Plot
from koopcli.figures.kit.figure import Drawing, drawing
from koopcli.records import Meta
from koopcli.stages.base import Context, Cost, Inputs, Stage


def _run(settings: Plot, inputs: Inputs, context: Context) -> Drawing:
    return drawing(settings, inputs, __version__)


def _figures(drawing: Drawing) -> Meta:
    return {"figure": drawing.figure, "format": drawing.format, "bytes": len(drawing.image)}


STAGE = Stage(
    name="plot",
    version=6,
    settings=lambda values: build(Plot, values),
    run=_run,
    unpack=Drawing.unpack,
    figures=_figures,
    describe=lambda f, settings: f"{f['figure']}, {f['format']}, {f['bytes']} bytes",
    check=lambda task: None,
    estimate=lambda task: Cost(1.0, 1e5),
)
