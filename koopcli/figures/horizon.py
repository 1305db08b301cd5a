"""Error against time: how far ahead a prediction can be trusted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from koopcli.config.pictures import Plot
from koopcli.figures.colours import COLOURS
from koopcli.figures.drawing import LOST, Source, column, with_error
from koopcli.figures.style import COLUMN, legend_below, looks, plain, plain_numbers, style
from koopcli.records import Array, BoolArray, FloatArray, Trajectories

QUANTILES = {"lower": 0.1, "median": 0.5, "upper": 0.9}
BLOCK = 4096  # trajectories predicted together
SHOWN_FROM = 1e-3  # %, of errors on a logarithmic axis; a start that is known is exact


@dataclass(frozen=True)
class ErrorOverTime:
    """Quantiles (samples,) over the trajectories, in percent, of the error at ``time`` (samples,) in s.

    The error at a sample is ‖x̂_k - x_k‖ over the root mean square of ‖x‖ along its trajectory, so that the root mean
    square of it over time is the RMSE.
    """

    label: str
    time: FloatArray
    lower: FloatArray
    median: FloatArray
    upper: FloatArray


def select(sources: Sequence[Source], settings: Plot) -> list[ErrorOverTime]:
    """What the figure shows. Raises ``InvalidValueError`` where every prediction of all evaluations diverged."""
    return [_over_time(source, shown) for source, shown in zip(sources, with_error(sources), strict=True)]


def _over_time(source: Source, shown: BoolArray) -> ErrorOverTime:
    evaluation, predictor = source.records["evaluation"], source.records["predictor"]
    test: Trajectories = source.records["trajectories"].finished()  # the rows of the evaluation
    assert isinstance(test, Trajectories)
    time = test.dt * np.arange(test.steps + 1.0)
    if not shown.any():
        return ErrorOverTime(source.label + LOST, time, *np.full((3, len(time)), np.nan))
    blocks = []
    for start in range(0, len(shown), BLOCK):
        rows, chosen = slice(start, start + BLOCK), shown[start : start + BLOCK]
        x, u = np.asarray(test.x[rows])[chosen], np.asarray(test.u[rows])[chosen]
        error = np.linalg.norm(predictor.predict(x[:, 0], u) - x, axis=2)
        size = np.sqrt((x[:, evaluation.first :] ** 2).sum(axis=2).mean(axis=1))
        blocks.append(100 * error / size[:, np.newaxis])
    relative = np.concatenate(blocks)
    statistics = {name: np.quantile(relative, q, axis=0) for name, q in QUANTILES.items()}
    return ErrorOverTime(source.label, time, **statistics)


def numbers(shown: Sequence[ErrorOverTime]) -> Mapping[str, Array]:
    """Time, and the quantiles of each evaluation."""
    found = {"time": column(shown[0].time, "sample", "s")}
    for one in shown:
        for name in QUANTILES:
            found[f"{one.label}/{name}".removeprefix("/")] = column(getattr(one, name), "sample", "%")
    return found


def draw(shown: Sequence[ErrorOverTime]) -> Figure:
    """Median and the band that holds eight of ten trajectories of one evaluation; medians of several."""
    with style():
        figure = Figure(figsize=(COLUMN, 2.6), layout="constrained")
        axes = figure.subplots()
        for one, look in zip(shown, looks(len(shown)), strict=True):
            if len(shown) == 1:
                axes.fill_between(
                    one.time,
                    _seen(one.lower),
                    _seen(one.upper),
                    color=COLOURS[5],
                    alpha=0.4,
                    linewidth=0,
                    label="10 to 90 % of trajectories",
                )
            median = _seen(one.median)
            alone = np.isfinite(median).sum() == 1  # a line of one point is none
            axes.plot(one.time, median, marker="o" if alone else "", label=plain(one.label) or "median", **look)
        axes.set_yscale("log")
        plain_numbers(axes.yaxis)
        axes.set_xlabel("time (s)")
        axes.set_ylabel("error (% of the trajectory's size)" if len(shown) == 1 else "median error (% of the size)")
        axes.set_xlim(shown[0].time[0], shown[0].time[-1])
        legend_below(figure)
    return figure


def _seen(values: FloatArray) -> FloatArray:
    """Errors that a logarithmic axis can show; an exact start has none."""
    return np.where(values > SHOWN_FROM, values, np.nan)
