"""Where the errors are: every initial state in two planes, its size and colour the RMSE of its trajectory."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from koopcli.config.settings import Series
from koopcli.errors import InvalidValueError
from koopcli.figures.drawing import Drawing, column
from koopcli.figures.style import COLUMN, SHADES, TRAINING, axis_label, render, style
from koopcli.koopman.evaluation import Evaluation
from koopcli.records import Array, Channels, FloatArray, Trajectories

PATHS = 500  # training trajectories drawn at most
LARGEST_SHOWN = 0.98  # quantile of the errors where the colours end


@dataclass(frozen=True)
class ErrorMap:
    """``x0`` (n, n_x) with its ``rmse`` (n,) in percent, and the training ``paths`` (J, samples, n_x)."""

    x0: FloatArray
    rmse: FloatArray
    paths: FloatArray
    channels: Channels


def error_map(evaluation: Evaluation, training: Trajectories) -> ErrorMap:
    """What the figure shows. Raises ``InvalidValueError`` where every prediction diverged."""
    shown = np.isfinite(evaluation.rmse) & ~evaluation.diverged
    if not shown.any():
        raise InvalidValueError("every prediction of this evaluation diverged: there is no error to draw")
    order = np.argsort(evaluation.rmse[shown], kind="stable")  # the largest errors lie on top
    each = -(-len(training) // PATHS)
    paths = np.asarray(training.x[::each])
    return ErrorMap(evaluation.x0[shown][order], evaluation.rmse[shown][order], paths, evaluation.state_channels)


def drawing(series: Sequence[Series], inputs: Mapping[str, Any], image: str) -> Drawing:
    """The figure with its numbers."""
    shown = error_map(inputs["0/evaluation"], inputs["0/training"])
    numbers: dict[str, Array] = {"rmse": column(shown.rmse, "trajectory", "%")}
    for i, (name, unit) in enumerate(zip(shown.channels.names, shown.channels.units, strict=True)):
        numbers[f"{name}_0"] = column(shown.x0[:, i], "trajectory", unit)
    return Drawing("error-map", image, numbers, render(draw(shown), image))


def draw(shown: ErrorMap) -> Figure:
    """The first two states against one another, and the last two, over the training trajectories in grey."""
    names = [axis_label(n, u) for n, u in zip(shown.channels.names, shown.channels.units, strict=True)]
    n_x = len(names)
    top = float(np.quantile(shown.rmse, LARGEST_SHOWN))
    size = 1 + 14 * np.clip(shown.rmse / top, 0, 1)
    with style():
        figure = Figure(figsize=(COLUMN, 5.4), layout="constrained")
        panels = figure.subplots(2)
        for axes, (i, j) in zip(panels, ((0, 1), (n_x - 2, n_x - 1)), strict=True):
            if shown.paths.shape[1] > 2:
                lines = list(shown.paths[:, :, [i, j]])
                axes.add_collection(LineCollection(lines, colors=TRAINING, linewidths=0.3, rasterized=True))
            else:  # single steps are too short to see
                axes.plot(shown.paths[:, 0, i], shown.paths[:, 0, j], "s", color=TRAINING, markersize=3, zorder=1)
            balls = axes.scatter(
                shown.x0[:, i],
                shown.x0[:, j],
                s=size,
                c=shown.rmse,
                cmap=SHADES,
                vmin=0,
                vmax=top,
                linewidths=0,
                zorder=3,
                rasterized=True,
            )
            axes.set_xlabel(names[i])
            axes.set_ylabel(names[j])
            axes.autoscale_view()
        beyond = "max" if shown.rmse.max() > top else "neither"
        figure.colorbar(balls, ax=list(panels), label="RMSE (%)", extend=beyond, shrink=0.6)
    return figure
