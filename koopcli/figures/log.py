"""A log: its signals over time in the units of its map, where it has gaps, and what was flagged in it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from koopcli.config.pictures import Plot
from koopcli.figures.kit.figure import FigureKind, Source, column
from koopcli.figures.kit.style import (
    COLOURS,
    COLUMN,
    GUIDE,
    SMALLEST,
    TRAINING,
    Figure,
    axis_label,
    plain,
    style,
    ticks,
)
from koopcli.logs.check import Check
from koopcli.logs.imported import Log
from koopcli.logs.units import unit
from koopcli.records import Array, Episodes, FloatArray

FIGURE = FigureKind(about="signals of a log, its gaps, and what was flagged", takes="log")

PANEL, BESIDES, ROW = 0.75, 0.5, 0.14  # inches: a panel, what is around them, and a line of words
MOST = 6000  # points of a line
BETWEEN = 0.02  # of the whole: between two recordings


@dataclass(frozen=True)
class Shown:
    """``time`` (rows,) in s, recordings one after another; ``signals`` (rows,) by label; ``gaps``: from and to in s;
    ``breaks``: the first row of each episode; ``doubts``: what was flagged, in words.
    """

    time: FloatArray
    signals: Mapping[str, FloatArray]
    units: Mapping[str, str]
    gaps: Sequence[tuple[float, float]]
    breaks: Sequence[int]
    doubts: Sequence[str]


def select(sources: Sequence[Source], settings: Plot) -> Shown:
    """What the figure shows."""
    log: Log = sources[0].records["log"]
    episodes = log.episodes
    time, gaps = _laid_out(episodes)
    x, u = np.asarray(episodes.x[:]), np.asarray(episodes.u[:])
    names = (*episodes.state_channels.names, *episodes.input_channels.names)
    si = (*episodes.state_channels.units, *episodes.input_channels.units)
    units = {name: log.display.get(name, text) for name, text in zip(names, si, strict=True)}
    columns = zip(names, np.hstack([x, u]).T, strict=True)
    return Shown(
        time,
        {name: values / unit(units[name]).factor for name, values in columns},
        units,
        gaps,
        episodes.bounds[:-1].tolist(),
        [_words(check) for check in log.checks if check.verdict in ("warn", "ask")],
    )


def _laid_out(episodes: Episodes) -> tuple[FloatArray, list[tuple[float, float]]]:
    """The time of every row from the start of the first recording, and the gaps between episodes."""
    time, gaps, at = episodes.time, [], 0.0
    between = BETWEEN * episodes.dt * episodes.rows
    out = np.empty(episodes.rows)
    for i, (start, stop) in enumerate(pairwise(episodes.bounds)):
        if i and episodes.runs[i] != episodes.runs[i - 1]:
            at += between
        elif i:
            at += max(float(time[start] - time[start - 1]) - episodes.dt, 0.0)
        if i:
            gaps.append((float(out[start - 1]), at))
        out[start:stop] = at + episodes.dt * np.arange(stop - start)
        at = float(out[stop - 1]) + episodes.dt
    return out, gaps


def _words(check: Check) -> str:
    about = f"{check.name.replace('_', ' ')}{f' of {check.signal}' if check.signal else ''}"
    return f"{check.verdict}: {about} {check.measured}"


def numbers(shown: Shown) -> Mapping[str, Array]:
    """Time and every signal."""
    columns = {"time": column(shown.time, "row", "s")}
    return columns | {name: column(values, "row", shown.units[name]) for name, values in shown.signals.items()}


def draw(shown: Shown) -> Figure:
    """A panel for each signal; grey where nothing was recorded; below, in words, what was flagged."""
    count = len(shown.signals)
    height = PANEL * count + BESIDES + ROW * len(shown.doubts)
    stride = max(1, len(shown.time) // MOST)
    with style():
        figure = Figure(figsize=(COLUMN, height), layout="constrained")
        panels = np.atleast_1d(figure.subplots(count, sharex=True))
        for panel, (name, values) in zip(panels, shown.signals.items(), strict=True):
            for low, high in shown.gaps:
                panel.axvspan(low, high, color=TRAINING, linewidth=0)
            ends = [*shown.breaks, len(values)]
            for start, stop in pairwise(ends):
                rows = slice(start, stop, stride)
                panel.plot(shown.time[rows], values[rows], color=COLOURS[0], linewidth=0.7)
            panel.set_title(axis_label(name.replace("$", ""), shown.units[name]), loc="left", fontsize=SMALLEST, pad=2)
            ticks(panel.yaxis, 3)
        panels[-1].set_xlabel("nothing was recorded where it is grey; time (s)")
        if shown.doubts:
            figure.supxlabel("\n".join(map(plain, shown.doubts)), fontsize=SMALLEST, color=GUIDE, ha="center")
    return figure
