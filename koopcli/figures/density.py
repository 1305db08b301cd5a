"""Error against the distance to the data: whether errors sit where data are missing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from koopcli.config.pictures import Plot
from koopcli.figures.colours import COLOURS, PAPER
from koopcli.figures.drawing import Source, column, with_error
from koopcli.figures.style import COLUMN, legend_below, plain_numbers, style
from koopcli.records import Array, BoolArray, FloatArray

GROUPS = 20  # of equally many trajectories, by distance


@dataclass(frozen=True)
class Density:
    """``rmse`` (n,) in percent against ``distance`` (n,) of x0 to the training states in half-widths of their box, and
    whether it lies ``outside`` (n,) their hull; medians ``typical`` (groups, 2) of distance and RMSE by distance.
    """

    distance: FloatArray
    rmse: FloatArray
    outside: BoolArray
    typical: FloatArray


def select(sources: Sequence[Source], settings: Plot) -> Density:
    """What the figure shows. Raises ``InvalidValueError`` where every prediction diverged."""
    evaluation = sources[0].records["evaluation"]
    (shown,) = with_error(sources)
    distance, rmse = evaluation.distance[shown], evaluation.rmse[shown]
    groups = np.array_split(np.argsort(distance, kind="stable"), min(GROUPS, len(rmse)))
    typical = np.array([[np.median(distance[group]), np.median(rmse[group])] for group in groups])
    return Density(distance, rmse, np.asarray(evaluation.outside[shown], dtype=bool), typical)


def numbers(shown: Density) -> Mapping[str, Array]:
    """Every trajectory, and the medians of the groups."""
    return {
        "distance": column(shown.distance, "trajectory", "half-widths"),
        "rmse": column(shown.rmse, "trajectory", "%"),
        "outside": column(shown.outside, "trajectory", "1"),
        "group/distance": column(shown.typical[:, 0], "group", "half-widths"),
        "group/rmse": column(shown.typical[:, 1], "group", "%"),
    }


def draw(shown: Density) -> Figure:
    """A dot for each trajectory, the medians as a line over them."""
    with style():
        figure = Figure(figsize=(COLUMN, 2.7), layout="constrained")
        axes = figure.subplots()
        for which, colour, marker, size, label in (
            (~shown.outside, COLOURS[5], "o", 2, "$x_0$ inside the hull of the data"),
            (shown.outside, COLOURS[1], "^", 3, "$x_0$ outside"),
        ):
            if which.any():
                axes.plot(
                    shown.distance[which],
                    shown.rmse[which],
                    marker,
                    color=colour,
                    markersize=size,
                    markeredgewidth=0,
                    label=f"{label} ({which.sum()})",
                    rasterized=True,
                )
        axes.plot(*shown.typical.T, "-", color=PAPER, label="median by distance")
        axes.set_yscale("log")
        plain_numbers(axes.yaxis)
        axes.set_xlabel("distance of $x_0$ to the data (half-widths of its box)")
        axes.set_ylabel("RMSE (%)")
        legend_below(figure, markerscale=2)
    return figure
