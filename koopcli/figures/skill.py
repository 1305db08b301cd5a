"""Error against horizon on rows that no fit saw: hold, DMD with control, and the predictor that was chosen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from koopcli.config.pictures import Plot
from koopcli.figures.kit.figure import FigureKind, Source, column
from koopcli.figures.kit.style import BAND, COLOURS, COLUMN, OTHERS, Figure, axis_label, legend_below, style, ticks
from koopcli.koopman.selection.record import CHOSEN, DMDC_ROW, HOLD, Selection
from koopcli.records import Array, Channels, FloatArray

FIGURE = FigureKind(
    about="error against horizon on held-out rows: hold, DMD with control, the chosen", takes="selection"
)

NAMES = {HOLD: "hold the state", DMDC_ROW: "DMD with control", CHOSEN: "the chosen predictor"}
LOOKS: dict[str, dict[str, Any]] = {
    HOLD: {"color": OTHERS[1], "linestyle": ":"},
    DMDC_ROW: {"color": OTHERS[0], "linestyle": "--"},
    CHOSEN: {"color": COLOURS[0], "linewidth": 1.8},
}
PANEL, BESIDES = 1.1, 0.7  # inches


@dataclass(frozen=True)
class Skill:
    """``errors`` (steps, n_x) of each model at ``time`` (steps,) in s; ``low`` and ``high`` (steps, n_x): of the chosen
    over the blocks.
    """

    time: FloatArray
    errors: Mapping[str, FloatArray]
    low: FloatArray
    high: FloatArray
    channels: Channels


def select(sources: Sequence[Source], settings: Plot) -> Skill:
    """What the figure shows."""
    selection: Selection = sources[0].records["selection"]
    errors = {model: selection.pooled(model) for model in NAMES}
    low, high = selection.span(CHOSEN)
    time = selection.dt * np.arange(1.0, len(low) + 1)
    return Skill(time, errors, low, high, selection.state_channels)


def numbers(shown: Skill) -> Mapping[str, Array]:
    """Time, and the error of every model in every state."""
    columns = {"time": column(shown.time, "step", "s")}
    for i, (state, unit) in enumerate(zip(shown.channels.names, shown.channels.units, strict=True)):
        for model, errors in shown.errors.items():
            columns[f"{state}/{model}"] = column(errors[:, i], "step", unit)
    return columns


def draw(shown: Skill) -> Figure:
    """A panel for each state; the band is from the best to the worst block held out."""
    count = len(shown.channels)
    with style():
        figure = Figure(figsize=(COLUMN, PANEL * count + BESIDES), layout="constrained")
        panels = np.atleast_1d(figure.subplots(count, sharex=True))
        for i, panel in enumerate(panels):
            label = "best to worst block" if i == 0 else None
            panel.fill_between(shown.time, shown.low[:, i], shown.high[:, i], color=BAND, linewidth=0, label=label)
            for model, errors in shown.errors.items():
                panel.plot(shown.time, errors[:, i], label=NAMES[model] if i == 0 else None, **LOOKS[model])
            panel.set_ylabel(axis_label(shown.channels.names[i], shown.channels.units[i]))
            panel.set_ylim(bottom=0)
            panel.set_xlim(0, shown.time[-1])
            ticks(panel.yaxis, 3)
        panels[0].set_title("RMSE on rows held out", loc="left", fontsize=8)
        panels[-1].set_xlabel("time ahead (s)")
        legend_below(figure)
    return figure
