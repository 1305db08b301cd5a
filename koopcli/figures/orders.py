"""RMSE against the order of the basis, with the paper's two best points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import cycle
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator

from koopcli.config.paper import BEST_ORDERS, BEST_RMSE
from koopcli.config.settings import Series
from koopcli.figures.drawing import Drawing, column
from koopcli.figures.style import COLOURS, COLUMN, MARKERS, PAPER, render, style
from koopcli.records import Array, FloatArray


@dataclass(frozen=True)
class OrderErrors:
    """Errors in percent by order, for one training draw and one kind of test inputs."""

    label: str
    order: npt.NDArray[np.int64]
    mean: FloatArray
    median: FloatArray
    maximum: FloatArray


def curves(series: Sequence[Series], inputs: Mapping[str, Any]) -> list[OrderErrors]:
    """Evaluations grouped by label, each group by rising order."""
    groups: dict[str, list[tuple[int, dict[str, float]]]] = {}
    for i, one in enumerate(series):
        score = inputs[f"{i}/evaluation"].figures()["rmse"]
        groups.setdefault(one.label, []).append((one.order or 0, score))
    found = []
    for label, members in groups.items():
        ordered = sorted(members, key=lambda member: member[0])
        order = np.array([order for order, _ in ordered])
        statistics = (np.array([score[name] for _, score in ordered]) for name in ("mean", "median", "max"))
        found.append(OrderErrors(label, order, *statistics))
    return found


def drawing(series: Sequence[Series], inputs: Mapping[str, Any], image: str) -> Drawing:
    """The figure with its numbers."""
    drawn = curves(series, inputs)
    numbers: dict[str, Array] = {}
    for curve in drawn:
        numbers[f"{curve.label}/order"] = column(curve.order.astype(float), "order", "1")
        for statistic in ("mean", "median", "maximum"):
            numbers[f"{curve.label}/{statistic}"] = column(getattr(curve, statistic), "order", "%")
    return Drawing("orders", image, numbers, render(draw(drawn), image))


def draw(curves: Sequence[OrderErrors]) -> Figure:
    """Mean, median and maximum of one curve; of several only the means, one colour each."""
    with style():
        figure = Figure(figsize=(COLUMN, 2.6), layout="constrained")
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
        axes.plot(BEST_ORDERS, points, "x", color=PAPER, markersize=6, label=label)
        axes.set_yscale("log")
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        axes.set_xlabel("order of the polynomial basis")
        axes.set_ylabel("RMSE (%)")
        figure.legend(loc="outside lower center", ncols=2, title=curves[0].label if len(curves) == 1 else None)
    return figure
