"""Error against the distance to the data: whether errors sit where data are missing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from koopcli.config.pictures import Plot
from koopcli.figures.kit.figure import FigureKind, Source, column, with_error
from koopcli.figures.kit.style import BAND, COLOURS, COLUMN, Figure, legend_below, plain_numbers, style
from koopcli.records import Array, BoolArray, FloatArray

FIGURE = FigureKind(
    about="RMSE against the distance of the initial state to the data",
    takes="evaluation",
    usual="fit-eigen",
)

BINS, FEWEST = 20, 20  # of distance, even; trajectories that a group of them has at least
QUANTILES = (0.1, 0.25, 0.5, 0.75, 0.9)


@dataclass(frozen=True)
class Density:
    """``rmse`` (n,) in percent against ``distance`` (n,) of x0 to the training states in half-widths of their box, and
    whether it lies ``outside`` (n,) their hull; the ``quantiles`` (5, groups) of the RMSE between ``edges``
    (groups + 1,) of distance, the first and the last of all.
    """

    distance: FloatArray
    rmse: FloatArray
    outside: BoolArray
    edges: FloatArray
    quantiles: FloatArray


def select(sources: Sequence[Source], settings: Plot) -> Density:
    """What the figure shows. Raises ``InvalidValueError`` where every prediction diverged."""
    evaluation = sources[0].records["evaluation"]
    (shown,) = with_error(sources)
    distance, rmse = evaluation.distance[shown], evaluation.rmse[shown]
    edges = _edges(distance)
    group = np.clip(np.searchsorted(edges, distance, side="right") - 1, 0, len(edges) - 2)
    quantiles = np.array([np.quantile(rmse[group == i], QUANTILES) for i in range(len(edges) - 1)]).T
    return Density(distance, rmse, np.asarray(evaluation.outside[shown], dtype=bool), edges, quantiles)


def _edges(distance: FloatArray) -> FloatArray:
    """Ends (groups + 1,) of even bins; one of few trajectories is joined to the next, the last to the one before."""
    even = np.linspace(distance.min(), distance.max(), BINS + 1)
    kept, held = [even[0]], np.searchsorted(np.sort(distance), even)
    last, count = 0, len(distance)
    for edge, below in zip(even[1:-1], held[1:-1], strict=True):
        if below - last >= FEWEST and count - below >= FEWEST:
            kept.append(edge)
            last = below
    return np.array([*kept, even[-1]])


def numbers(shown: Density) -> Mapping[str, Array]:
    """Every trajectory, and the quantiles of the groups."""
    return {
        "distance": column(shown.distance, "trajectory", "half-widths"),
        "rmse": column(shown.rmse, "trajectory", "%"),
        "outside": column(shown.outside, "trajectory", "1"),
        "group/distance from": column(shown.edges[:-1], "group", "half-widths"),
        "group/distance to": column(shown.edges[1:], "group", "half-widths"),
        **{
            f"group/rmse {100 * q:g} %": column(values, "group", "%")
            for q, values in zip(QUANTILES, shown.quantiles, strict=True)
        },
    }


def draw(shown: Density) -> Figure:
    """Bands of quantiles from the nearest state to the farthest, and a mark for each state outside the hull."""
    lowest, lower, median, upper, highest = shown.quantiles
    with style():
        figure = Figure(figsize=(COLUMN, 2.5), layout="constrained")
        axes = figure.subplots()
        for low, high, colour, label in (
            (lowest, highest, BAND, "10 to 90 % of the states"),
            (lower, upper, COLOURS[5], "25 to 75 %"),
        ):
            axes.stairs(high, shown.edges, baseline=low, fill=True, color=colour, linewidth=0, label=label)
        axes.stairs(median, shown.edges, baseline=None, color=COLOURS[0], linewidth=1.6, label="median")
        out = shown.outside
        if out.any():
            label = f"outside the hull ({out.sum()})"
            look: dict[str, Any] = {"color": COLOURS[1], "markersize": 4, "markeredgecolor": "white", "mew": 0.4}
            axes.plot(shown.distance[out], shown.rmse[out], "^", label=label, **look)
        axes.set_yscale("log")
        plain_numbers(axes.yaxis)
        axes.set_xlim(left=0)
        axes.set_xlabel("distance of $x_0$ to the data (half-widths of its box)")
        axes.set_ylabel("RMSE (%)")
        legend_below(figure)
    return figure
