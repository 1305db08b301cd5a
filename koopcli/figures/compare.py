"""Several predictors on one test set: the spread of their errors side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from textwrap import fill

import numpy as np

from koopcli.config.pictures import Plot
from koopcli.figures.kit.figure import FigureKind, Source, column, with_error
from koopcli.figures.kit.style import COLOURS, COLUMN, LINE, Figure, plain, plain_numbers, style
from koopcli.records import Array, BoolArray, FloatArray

FIGURE = FigureKind(
    about="the errors of several predictors on one test set, side by side",
    takes="evaluation",
    draws="beside",
    makes=lambda recipes, experiment: recipes.side_by_side(experiment),
    usual="fit-eigen",
    instead="it sets one predictor beside fixed baselines and EDMD fits; name evaluations to choose others",
)

WIDEST = 34  # letters of a name in a line
QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)


@dataclass(frozen=True)
class Spread:
    """The RMSE of one predictor's trajectories in percent: ``quantiles`` (5,) and ``mean``, not numbers where every
    prediction diverged; how many ``diverged``.
    """

    label: str
    quantiles: FloatArray
    mean: float
    diverged: int


def select(sources: Sequence[Source], settings: Plot) -> list[Spread]:
    """What the figure shows. Raises ``InvalidValueError`` where every prediction of all evaluations diverged."""
    return [_spread(source, shown) for source, shown in zip(sources, with_error(sources), strict=True)]


def _spread(source: Source, shown: BoolArray) -> Spread:
    evaluation = source.records["evaluation"]
    rmse, diverged = evaluation.rmse[shown], int(evaluation.diverged.sum())
    if not len(rmse):
        return Spread(source.label, np.full(len(QUANTILES), np.nan), np.nan, diverged)
    return Spread(source.label, np.quantile(rmse, QUANTILES), float(rmse.mean()), diverged)


def numbers(shown: Sequence[Spread]) -> Mapping[str, Array]:
    """For each predictor its quantiles, its mean and how many diverged."""
    columns = {"quantile": column(np.array(QUANTILES), "quantile", "1")}
    for spread in shown:
        columns[f"{spread.label}/rmse"] = column(spread.quantiles, "quantile", "%")
        columns[f"{spread.label}/mean"] = column(np.array([spread.mean]), "predictor", "%")
        columns[f"{spread.label}/diverged"] = column(np.array([float(spread.diverged)]), "predictor", "1")
    return columns


def draw(shown: Sequence[Spread]) -> Figure:
    """A row for each predictor, in the order given: box and whiskers with the mean, which is written beside it."""
    with style():
        figure = Figure(figsize=(COLUMN, 1.0 + 0.3 * len(shown) + LINE * _wrapped(shown)), layout="constrained")
        axes = figure.subplots()
        first_drawn = next(row for row, spread in enumerate(shown) if np.isfinite(spread.mean))
        for row, spread in enumerate(shown):
            if not np.isfinite(spread.mean):
                continue
            named = str if row == first_drawn else _nameless
            low, first, median, third, high = spread.quantiles
            axes.plot([low, high], [row, row], "-", color=COLOURS[0], linewidth=0.8, zorder=2, label=named("5 to 95 %"))
            axes.barh(row, third - first, left=first, height=0.5, color=COLOURS[5], zorder=3, label=named("quartiles"))
            axes.plot(
                [median, median],
                [row - 0.25, row + 0.25],
                "-",
                color=COLOURS[0],
                linewidth=1.6,
                zorder=4,
                label=named("median"),
            )
            axes.plot(spread.mean, row, "D", color=COLOURS[1], markersize=4, zorder=5, label=named("mean"))
        axes.use_sticky_edges = False
        axes.set_xscale("log")
        axes.margins(x=0.06)
        plain_numbers(axes.xaxis)
        axes.set_ylim(len(shown) - 0.5, -0.5)
        axes.set_yticks(range(len(shown)), [_row(spread) for spread in shown])
        axes.grid(visible=False, axis="y")
        axes.set_xlabel("RMSE (%)")
        figure.legend(loc="outside lower center", ncols=4, columnspacing=1.0, handletextpad=0.5)
    return figure


def _nameless(label: str) -> None:
    """No entry of the legend: another row has it."""


def _wrapped(shown: Sequence[Spread]) -> int:
    """Lines of names beyond one each."""
    return sum(_row(spread).count("\n") - 1 for spread in shown)


def _row(spread: Spread) -> str:
    name = fill(plain(spread.label), WIDEST)
    if not np.isfinite(spread.mean):
        return f"{name}\nall diverged"
    lost = f", {spread.diverged} diverged" if spread.diverged else ""
    return f"{name}\nmean {spread.mean:.3g} %{lost}"
