"""The test trajectory whose RMSE is nearest the mean: what the mean error looks like."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from koopcli.config.settings import Series
from koopcli.errors import InvalidValueError
from koopcli.figures.drawing import Drawing, column
from koopcli.figures.style import COLOURS, COLUMN, axis_label, render, style
from koopcli.koopman.evaluation import Evaluation, Forecaster
from koopcli.records import Array, Channels, FloatArray, Trajectories


@dataclass(frozen=True)
class MeanTrajectory:
    """``true`` and ``predicted`` (samples, n_x) at ``time`` (samples,) in s; ``rmse`` and the ``mean`` in percent."""

    time: FloatArray
    true: FloatArray
    predicted: FloatArray
    rmse: float
    mean: float
    channels: Channels


def mean_trajectory(evaluation: Evaluation, predictor: Forecaster, test: Trajectories) -> MeanTrajectory:
    """What the figure shows. Raises ``InvalidValueError`` where every prediction diverged."""
    rmse = np.where(evaluation.diverged, np.nan, evaluation.rmse)
    if not np.isfinite(rmse).any():
        raise InvalidValueError("every prediction of this evaluation diverged: there is no mean error to draw")
    mean = float(np.nanmean(rmse))
    j = int(np.nanargmin(np.abs(rmse - mean)))
    true = np.asarray(test.x[j : j + 1])
    predicted = predictor.predict(true[:, 0], np.asarray(test.u[j : j + 1]))
    time = predictor.dt * np.arange(test.steps + 1.0)
    return MeanTrajectory(time, true[0], predicted[0], float(rmse[j]), mean, test.state_channels)


def drawing(series: Sequence[Series], inputs: Mapping[str, Any], image: str) -> Drawing:
    """The figure with its numbers."""
    shown = mean_trajectory(inputs["0/evaluation"], inputs["0/predictor"], inputs["0/trajectories"])
    numbers: dict[str, Array] = {"time": column(shown.time, "sample", "s")}
    for i, (name, unit) in enumerate(zip(shown.channels.names, shown.channels.units, strict=True)):
        numbers[f"{name}/true"] = column(shown.true[:, i], "sample", unit)
        numbers[f"{name}/predicted"] = column(shown.predicted[:, i], "sample", unit)
    return Drawing("mean-trajectory", image, numbers, render(draw(shown), image))


def draw(shown: MeanTrajectory) -> Figure:
    """One panel for each state."""
    n_x = len(shown.channels)
    with style():
        figure = Figure(figsize=(COLUMN, 1.15 * n_x + 0.6), layout="constrained")
        panels = figure.subplots(n_x, sharex=True)
        for i, axes in enumerate(panels):
            axes.plot(shown.time, shown.true[:, i], "-", color=COLOURS[0], label="true")
            axes.plot(shown.time, shown.predicted[:, i], "--", color=COLOURS[1], label="predicted")
            axes.plot(shown.time[0], shown.true[0, i], "o", color=COLOURS[0])
            axes.plot(shown.time[0], shown.predicted[0, i], "s", color=COLOURS[1])
            axes.set_ylabel(axis_label(shown.channels.names[i], shown.channels.units[i]))
        panels[-1].set_xlabel("time (s)")
        figure.align_ylabels()
        handles, labels = panels[0].get_legend_handles_labels()
        title = f"RMSE {shown.rmse:.4g} % (mean of all {shown.mean:.4g} %)"
        figure.legend(handles, labels, loc="outside lower center", ncols=2, title=title)
    return figure
