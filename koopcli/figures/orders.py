"""RMSE against the order of the basis, with the paper's two best points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import cycle
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator

from koopcli.config.paper import BEST_ORDERS, BEST_RMSE
from koopcli.figures.drawing import Drawing, column
from koopcli.figures.style import COLOURS, COLUMN, MARKERS, PAPER, render, style
from koopcli.records import FloatArray

INPUTS = {"none": "no input", "fresh": "fresh inputs", "held": "held inputs"}


@dataclass(frozen=True)
class OrderErrors:
    """Errors in percent by order, for one training draw and one kind of test inputs."""

    draw: str
    excitation: str
    order: npt.NDArray[np.int64]
    mean: FloatArray
    median: FloatArray
    maximum: FloatArray

    @property
    def label(self) -> str:
        """What the legend calls it."""
        return f"{self.draw}, {INPUTS.get(self.excitation, self.excitation)}"


def drawing(curves: Sequence[OrderErrors], image: str) -> Drawing:
    """The figure with its numbers."""
    numbers: dict[str, Any] = {}
    for curve in curves:
        name = f"{curve.draw} {curve.excitation}"
        numbers[f"{name}/order"] = column(curve.order.astype(float), "order", "1")
        for statistic in ("mean", "median", "maximum"):
            numbers[f"{name}/{statistic}"] = column(getattr(curve, statistic), "order", "%")
    return Drawing("orders", image, numbers, render(draw(curves), image))


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
