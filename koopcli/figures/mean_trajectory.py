"""The test trajectory whose RMSE is nearest the mean: what the mean error looks like."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from koopcli.config.pictures import Plot
from koopcli.figures.kit.figure import FigureKind, Source, column, state_columns, with_error
from koopcli.figures.kit.style import COLOURS, COLUMN, Figure, axis_label, style
from koopcli.records import Array, Channels, FloatArray, Trajectories

FIGURE = FigureKind(
    about="the test trajectory whose RMSE is nearest the mean, true and predicted",
    takes="evaluation",
    behind=("predictor", "trajectories"),
    usual="fit-eigen",
)


@dataclass(frozen=True)
class MeanTrajectory:
    """``true`` and ``predicted`` (samples, n_x) at ``time`` (samples,) in s; ``rmse`` and the ``mean`` in percent."""

    time: FloatArray
    true: FloatArray
    predicted: FloatArray
    rmse: float
    mean: float
    channels: Channels


def select(sources: Sequence[Source], settings: Plot) -> MeanTrajectory:
    """What the figure shows. Raises ``InvalidValueError`` where every prediction diverged."""
    records = sources[0].records
    evaluation, predictor, test = records["evaluation"], records["predictor"], records["trajectories"].finished()
    assert isinstance(test, Trajectories)
    (shown,) = with_error(sources)
    rmse = np.where(shown, evaluation.rmse, np.nan)
    mean = float(np.nanmean(rmse))
    j = int(np.nanargmin(np.abs(rmse - mean)))
    true = np.asarray(test.x[j : j + 1])
    predicted = predictor.predict(true[:, 0], np.asarray(test.u[j : j + 1]))
    time = predictor.dt * np.arange(test.steps + 1.0)
    return MeanTrajectory(time, true[0], predicted[0], float(rmse[j]), mean, test.state_channels)


def numbers(shown: MeanTrajectory) -> Mapping[str, Array]:
    """Time, and every state true and predicted."""
    true = state_columns(shown.true, shown.channels, "sample", "{}/true")
    predicted = state_columns(shown.predicted, shown.channels, "sample", "{}/predicted")
    return {"time": column(shown.time, "sample", "s"), **true, **predicted}


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
