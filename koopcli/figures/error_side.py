"""The errors from the side, in the plane of the second and third state, over the training trajectories in grey."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from koopcli.config.pictures import Plot
from koopcli.figures.kit.balls import Balls, balls, columns
from koopcli.figures.kit.figure import FigureKind, Source, column, state_columns
from koopcli.figures.kit.style import COLUMN, SHADES, TRAINING, Figure, axis_label, legend_below, style
from koopcli.koopman.predictor.coverage import spread
from koopcli.records import Array, FloatArray, Trajectories

FIGURE = FigureKind(
    about="RMSE by initial state from the side, over the training trajectories",
    takes="evaluation",
    behind=("training",),
    usual="fit-eigen",
)

PATHS, STARTS = 500, 20_000  # training trajectories, or states of single steps, drawn at most
SIDE = [1, 2]  # the states of the plane


@dataclass(frozen=True)
class ErrorSide:
    """The ``balls`` and the training ``paths`` (J, samples, n_x), of single steps only the states they start from."""

    balls: Balls
    paths: FloatArray


def select(sources: Sequence[Source], settings: Plot) -> ErrorSide:
    """What the figure shows. Raises ``InvalidValueError`` where every prediction diverged."""
    training: Trajectories = sources[0].records["training"].finished()
    if training.steps == 1:  # too short to see: every state that is stepped from, once
        starts = np.unique(np.asarray(training.x[:, 0]), axis=0)
        return ErrorSide(balls(sources[0]), starts[spread(len(starts), STARTS), np.newaxis])
    each = -(-len(training) // PATHS)
    return ErrorSide(balls(sources[0]), np.asarray(training.x[::each]))


def numbers(shown: ErrorSide) -> Mapping[str, Array]:
    """Every initial state with its error, and the training trajectories one after another."""
    J, samples, n_x = shown.paths.shape
    paths = state_columns(shown.paths.reshape(-1, n_x), shown.balls.channels, "sample", "training {}")
    number = column(np.repeat(np.arange(J), samples), "sample", "1")
    return {**columns(shown.balls), "training trajectory": number, **paths}


def draw(shown: ErrorSide) -> Figure:
    """One plane."""
    from matplotlib.collections import LineCollection

    seen, channels = shown.balls, shown.balls.channels
    i, j = SIDE
    with style():
        figure = Figure(figsize=(COLUMN, 2.9), layout="constrained")
        axes = figure.subplots()
        if shown.paths.shape[1] > 1:
            lines = list(shown.paths[:, :, SIDE])
            name = "training trajectories"
            axes.add_collection(LineCollection(lines, colors=TRAINING, linewidths=0.3, rasterized=True, label=name))
        else:
            starts = np.unique(shown.paths[:, 0, SIDE], axis=0)
            axes.plot(*starts.T, "s", color=TRAINING, markersize=4, zorder=1, label="training states")
        balls = axes.scatter(
            seen.x0[:, i],
            seen.x0[:, j],
            s=seen.sizes,
            c=seen.rmse,
            cmap=SHADES,
            vmin=0,
            vmax=seen.top,
            linewidths=0,
            zorder=3,
            rasterized=True,
        )
        axes.set_xlabel(axis_label(channels.names[i], channels.units[i]))
        axes.set_ylabel(axis_label(channels.names[j], channels.units[j]))
        axes.autoscale_view()
        legend_below(figure)
        figure.colorbar(balls, ax=axes, label="RMSE (%)", extend=seen.beyond)
    return figure
