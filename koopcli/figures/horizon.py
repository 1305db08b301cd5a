"""Error against time: how far ahead a prediction can be trusted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from koopcli.config.pictures import Plot
from koopcli.figures.kit.ends import End, name_ends, room_for
from koopcli.figures.kit.figure import LOST, FigureKind, Source, column, with_error
from koopcli.figures.kit.style import BAND, COLOURS, COLUMN, DASHES, OTHERS, Figure, plain, plain_numbers, style
from koopcli.records import Array, BoolArray, FloatArray, Trajectories

FIGURE = FigureKind(
    about="error against time, of one predictor or of several on one test set",
    takes="evaluation",
    behind=("predictor", "trajectories"),
    draws="beside",
    makes=lambda recipes, experiment: recipes.side_by_side(experiment),
    usual="fit-eigen",
    instead="it sets one predictor beside fixed baselines and EDMD fits; name evaluations to choose others",
)

QUANTILES = {"lower": 0.1, "median": 0.5, "upper": 0.9}
BLOCK = 4096  # trajectories predicted together
THICK = 2.4  # points
LOWEST, BELOW = 1.9, 0.55  # inches: the panel at least, and what is below it
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
    columns = {"time": column(shown[0].time, "sample", "s")}
    for curve in shown:
        for name in QUANTILES:
            columns[f"{curve.label}/{name}".removeprefix("/")] = column(getattr(curve, name), "sample", "%")
    return columns


def draw(shown: Sequence[ErrorOverTime]) -> Figure:
    """Median and the band that holds eight of ten trajectories of one evaluation; the medians of several, the first
    thick and the others grey. Each line is named at its end.
    """
    alone = len(shown) == 1
    lines = _band(shown[0]) if alone else [_median(curve, i) for i, curve in enumerate(shown)]
    height = max(LOWEST, room_for([line.end.name for line in lines]))
    with style():
        figure = Figure(figsize=(COLUMN, height + BELOW), layout="constrained")
        axes = figure.subplots()
        time = shown[0].time
        if alone:
            axes.fill_between(time, _seen(shown[0].lower), _seen(shown[0].upper), color=BAND, linewidth=0)
        for line in lines:
            dot = "o" if np.isfinite(line.values).sum() == 1 else ""  # a line of one point is none
            axes.plot(time, line.values, marker=dot, label=line.end.name, **line.look)
        axes.set_yscale("log")
        plain_numbers(axes.yaxis)
        axes.set_xlabel("time (s)")
        axes.set_ylabel("error (% of the trajectory's size)" if alone else "median error (% of the size)")
        axes.set_xlim(time[0], time[-1])
        axes.set_ylim(*axes.get_ylim())
        name_ends(axes, [line.end for line in lines], height)
    return figure


@dataclass(frozen=True)
class _Line:
    """What is drawn at the times of the figure, how, and its end."""

    values: FloatArray
    look: dict[str, Any]
    end: End


def _median(curve: ErrorOverTime, place: int) -> _Line:
    """The median of one among several: the first is what the others are set beside."""
    values = _seen(curve.median)
    if place == 0:
        look, colour, weight = {"color": COLOURS[0], "linewidth": THICK, "zorder": 3}, COLOURS[0], "bold"
    else:
        colour, weight = OTHERS[0], "normal"
        look = {"color": OTHERS[place % len(OTHERS)], "linewidth": 1.0, "linestyle": DASHES[place % len(DASHES)]}
    return _Line(values, look, End(_last(values), plain(curve.label), colour, _leading(look), weight))


def _band(curve: ErrorOverTime) -> list[_Line]:
    """The median of the only evaluation, and the ends of its band."""
    ends = [("upper", "90 % are below", 0.6, OTHERS[0]), ("median", "median", THICK, COLOURS[0])]
    ends.append(("lower", "10 % are below", 0.6, OTHERS[0]))
    lines = []
    for name, text, width, colour in ends:
        values = _seen(getattr(curve, name))
        look = {"color": colour, "linewidth": width}
        lines.append(_Line(values, look, End(_last(values), text, colour, _leading(look))))
    return lines


def _leading(look: Mapping[str, Any]) -> dict[str, Any]:
    """The look of what leads from the end of a line to its name."""
    return {**look, "linewidth": min(0.8, look["linewidth"]), "zorder": 1}


def _last(values: FloatArray) -> float:
    """The last error that is drawn; one that diverged altogether is beyond all."""
    drawn = values[np.isfinite(values)]
    return float(drawn[-1]) if len(drawn) else np.inf


def _seen(values: FloatArray) -> FloatArray:
    """Errors that a logarithmic axis can show; an exact start has none."""
    return np.where(values > SHOWN_FROM, values, np.nan)
