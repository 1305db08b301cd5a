"""RMSE against the order of the basis, with the paper's two best points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import cycle

import numpy as np
import numpy.typing as npt

from koopcli.config.experiment import Experiment
from koopcli.config.paper import BEST_ORDERS, BEST_RMSE
from koopcli.config.pictures import Plot
from koopcli.errors import InvalidValueError
from koopcli.figures.kit.figure import FigureKind, Recipes, Source, Task, column
from koopcli.figures.kit.style import COLOURS, COLUMN, MARKERS, PAPER, Figure, legend_below, plain_numbers, style, ticks
from koopcli.records import Array, FloatArray


def _sweep(recipes: Recipes, experiment: Experiment) -> list[Task]:
    """One evaluation for each order of the experiment's sweep."""
    fits = (recipes.fit_edmd(recipes.with_order(experiment, order)) for order in experiment.reproduce.orders)
    return [recipes.evaluation(experiment, fit) for fit in fits]


FIGURE = FigureKind(
    about="RMSE against the order of the basis, beside the paper's best",
    takes="evaluation",
    draws="points",
    makes=_sweep,
    only="fit-edmd",
    instead="it sweeps reproduce.orders with sample.draw and test.excitation",
)


@dataclass(frozen=True)
class OrderErrors:
    """Errors in percent by order, for one training draw and one kind of test inputs."""

    label: str
    order: npt.NDArray[np.int64]
    mean: FloatArray
    median: FloatArray
    maximum: FloatArray


def select(sources: Sequence[Source], settings: Plot) -> list[OrderErrors]:
    """Evaluations grouped by label, each group by rising order.

    Raises ``InvalidValueError`` where every prediction of every evaluation diverged.
    """
    groups: dict[str, list[tuple[int, dict[str, float]]]] = {}
    for source in sources:
        score = source.records["evaluation"].figures()["rmse"]
        groups.setdefault(source.label, []).append((round(source.at or 0), score))
    curves = []
    for label, members in groups.items():
        ordered = sorted(members, key=lambda member: member[0])
        order = np.array([order for order, _ in ordered])
        statistics = (np.array([score[name] for _, score in ordered]) for name in ("mean", "median", "max"))
        curves.append(OrderErrors(label, order, *statistics))
    if not any(np.isfinite(curve.mean).any() for curve in curves):
        raise InvalidValueError("every prediction of these evaluations diverged: there is no error to draw")
    return curves


def numbers(curves: Sequence[OrderErrors]) -> Mapping[str, Array]:
    """Order, mean, median and maximum of each curve."""
    columns: dict[str, Array] = {}
    for curve in curves:
        columns[f"{curve.label}/order"] = column(curve.order, "order", "1")
        for statistic in ("mean", "median", "maximum"):
            columns[f"{curve.label}/{statistic}"] = column(getattr(curve, statistic), "order", "%")
    return columns


def draw(curves: Sequence[OrderErrors]) -> Figure:
    """Mean, median and maximum of one curve; of several only the means, one colour each."""
    with style():
        figure = Figure(figsize=(COLUMN, 2.7), layout="constrained")
        axes = figure.subplots()
        for curve, colour, marker in zip(curves, cycle(COLOURS), cycle(MARKERS), strict=False):
            if len(curves) == 1:
                axes.plot(curve.order, curve.maximum, ":^", color=COLOURS[1], label="maximum")
                axes.plot(curve.order, curve.mean, "-o", color=COLOURS[0], label="mean")
                axes.plot(curve.order, curve.median, "--s", color=COLOURS[2], label="median")
            else:
                axes.plot(curve.order, curve.mean, marker=marker, color=colour, label=curve.label)
        points = [BEST_RMSE] * len(BEST_ORDERS)
        label = f"paper's best ({BEST_RMSE} %)"
        axes.plot(BEST_ORDERS, points, "x", color=PAPER, markersize=6, markeredgewidth=1.4, label=label, zorder=5)
        axes.set_yscale("log")
        plain_numbers(axes.yaxis)
        ticks(axes.xaxis, integer=True)
        axes.set_xlabel("order of the polynomial basis")
        axes.set_ylabel("RMSE (%)")
        legend_below(figure, title=curves[0].label if len(curves) == 1 else None)
    return figure
