"""Measured and predicted states of a log, from several starts, with the band of past errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from koopcli.config.pictures import Plot
from koopcli.figures.kit.figure import FigureKind, Source, column
from koopcli.figures.kit.style import BAND, COLOURS, COLUMN, OTHERS, Figure, axis_label, legend_below, style, ticks
from koopcli.koopman.selection.score import Score, forecasts
from koopcli.logs.imported import Log
from koopcli.records import Array, Channels, FloatArray, IndexArray

FIGURE = FigureKind(
    about="measured and predicted states of a log, from several starts",
    takes="score",
    behind=("predictor", "trajectories"),
)

STARTS = 6  # predictions side by side
PANEL, BESIDES = 1.0, 0.8  # inches


@dataclass(frozen=True)
class Shown:
    """``measured``, ``predicted``, ``low`` and ``high`` (starts, steps + 1, n_x) at ``time`` (starts, steps + 1) in s,
    each start beside the one before.
    """

    time: FloatArray
    measured: FloatArray
    predicted: FloatArray
    low: FloatArray
    high: FloatArray
    channels: Channels


def select(sources: Sequence[Source], settings: Plot) -> Shown:
    """What the figure shows: starts where the states change the most, one in each part of the log."""
    records = sources[0].records
    score: Score = records["score"]
    log: Log = records["trajectories"]
    x, u = (np.asarray(values[...], dtype=float) for values in (log.episodes.x, log.episodes.u))
    steps = score.errors.shape[1]
    starts = _lively(score.starts, x, steps)
    measured = x[starts[:, np.newaxis] + np.arange(steps + 1)]
    predicted = forecasts(records["predictor"], x, u, starts, steps)
    band = np.concatenate([np.zeros((len(score.quantiles), 1, x.shape[1])), score.quantiles], axis=1)
    time = score.dt * (np.arange(steps + 1) + np.arange(len(starts))[:, np.newaxis] * (1.6 * steps))
    return Shown(time, measured, predicted, predicted + band[0], predicted + band[-1], score.state_channels)


def _lively(starts: IndexArray, x: FloatArray, steps: int) -> IndexArray:
    """The start of each part of the log from which the states move the most, in their spreads."""
    spread = np.where(x.std(axis=0) > 0, x.std(axis=0), 1.0)
    moved = (np.ptp(x[starts[:, np.newaxis] + np.arange(steps + 1)], axis=1) / spread).sum(axis=1)
    parts = np.array_split(np.arange(len(starts)), min(STARTS, len(starts)))
    return np.array([starts[part[np.argmax(moved[part])]] for part in parts])


def numbers(shown: Shown) -> Mapping[str, Array]:
    """Of every start: time, measured and predicted states."""
    columns = {"start": column(np.repeat(np.arange(len(shown.time)), shown.time.shape[1]), "sample", "1")}
    columns["time"] = column((shown.time - shown.time[:, :1]).ravel(), "sample", "s")
    for i, (state, unit) in enumerate(zip(shown.channels.names, shown.channels.units, strict=True)):
        for name in ("measured", "predicted", "low", "high"):
            columns[f"{state}/{name}"] = column(getattr(shown, name)[..., i].ravel(), "sample", unit)
    return columns


def draw(shown: Shown) -> Figure:
    """A panel for each state; the starts stand beside one another, each over the same time."""
    count = len(shown.channels)
    with style():
        figure = Figure(figsize=(COLUMN, PANEL * count + BESIDES), layout="constrained")
        panels = np.atleast_1d(figure.subplots(count, sharex=True))
        for i, panel in enumerate(panels):
            for j, time in enumerate(shown.time):
                named = i == j == 0
                low, high = shown.low[j, :, i], shown.high[j, :, i]
                panel.fill_between(time, low, high, color=BAND, linewidth=0, label="80 % of errors" if named else None)
                panel.plot(time, shown.measured[j, :, i], color=OTHERS[0], label="measured" if named else None)
                panel.plot(time, shown.predicted[j, :, i], color=COLOURS[1], label="predicted" if named else None)
                panel.plot(time[0], shown.measured[j, 0, i], "o", color=OTHERS[0], markersize=2.5)
            panel.set_ylabel(axis_label(shown.channels.names[i], shown.channels.units[i]))
            ticks(panel.yaxis, 3)
        ends = shown.time[:, [0, -1]].ravel()
        panels[-1].set_xticks(ends, [f"{time:.2g}" for time in np.tile(shown.time[0, [0, -1]], len(shown.time))])
        panels[-1].set_xlabel("time from each start (s)")
        legend_below(figure, columns=3)
    return figure
