"""How the RMSE of the trajectories is distributed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from koopcli.config.pictures import Plot
from koopcli.figures.kit.figure import LOST, FigureKind, Source, column, with_error
from koopcli.figures.kit.style import COLOURS, COLUMN, Figure, legend_below, looks, plain, plain_numbers, style
from koopcli.records import Array, FloatArray

FIGURE = FigureKind(
    about="how the RMSE of the trajectories is distributed",
    takes="evaluation",
    draws="beside",
    usual="fit-eigen",
)

BINS = 40
NARROWEST = 1.5  # ratio of the largest and the smallest RMSE of the bins


@dataclass(frozen=True)
class Histogram:
    """``share`` (bins,) of the trajectories in percent between ``edges`` (bins + 1,) in percent of RMSE."""

    label: str
    edges: FloatArray
    share: FloatArray
    mean: float
    median: float


def select(sources: Sequence[Source], settings: Plot) -> list[Histogram]:
    """What the figure shows, every evaluation in the same bins, even on a logarithmic axis.

    Raises ``InvalidValueError`` where every prediction of all evaluations diverged.
    """
    masks = with_error(sources)
    errors = [source.records["evaluation"].rmse[shown] for source, shown in zip(sources, masks, strict=True)]
    every = np.concatenate(errors)
    some = every[every > 0] if (every > 0).any() else np.ones(1)
    low, high = some.min(), max(some.max(), some.min() * NARROWEST)
    edges = np.geomspace(low * (1 - 1e-9), high * (1 + 1e-9), BINS + 1)
    histograms = []
    for source, rmse in zip(sources, errors, strict=True):
        if not len(rmse):
            histograms.append(Histogram(source.label + LOST, edges, np.zeros(BINS), np.nan, np.nan))
            continue
        counts = np.histogram(np.clip(rmse, edges[0], edges[-1]), edges)[0]
        share = 100 * counts / len(rmse)
        histograms.append(Histogram(source.label, edges, share, float(rmse.mean()), float(np.median(rmse))))
    return histograms


def numbers(shown: Sequence[Histogram]) -> Mapping[str, Array]:
    """The bins, and the share of each evaluation in them."""
    edges = shown[0].edges
    columns = {"rmse from": column(edges[:-1], "bin", "%"), "rmse to": column(edges[1:], "bin", "%")}
    for bars in shown:
        columns[f"{bars.label}/share".removeprefix("/")] = column(bars.share, "bin", "%")
    return columns


def draw(shown: Sequence[Histogram]) -> Figure:
    """Bars with mean and median of one evaluation; outlines of several."""
    with style():
        figure = Figure(figsize=(COLUMN, 2.5), layout="constrained")
        axes = figure.subplots()
        for bars, look in zip(shown, looks(len(shown)), strict=True):
            if len(shown) == 1:
                axes.stairs(bars.share, bars.edges, fill=True, color=COLOURS[5])
                axes.axvline(bars.mean, color=COLOURS[0], label=f"mean {bars.mean:.4g} %")
                axes.axvline(bars.median, color=COLOURS[1], linestyle="--", label=f"median {bars.median:.4g} %")
            else:
                median = f" (median {bars.median:.3g} %)" if np.isfinite(bars.median) else ""
                axes.stairs(bars.share, bars.edges, label=plain(bars.label) + median, linewidth=1.2, **look)
        axes.set_xscale("log")
        plain_numbers(axes.xaxis)
        axes.set_xlabel("RMSE (%)")
        axes.set_ylabel("share of trajectories (%)")
        legend_below(figure)
    return figure
