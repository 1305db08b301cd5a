"""The errors of several predictors by initial state, side by side in one scale of colours."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from koopcli.config.settings import Plot
from koopcli.figures.balls import Balls, balls, columns
from koopcli.figures.colours import SHADES
from koopcli.figures.drawing import Source
from koopcli.figures.style import axis_label, plain, style
from koopcli.records import Array

PANEL = 2.1  # inches
LEAST = 0.02  # quantile of all errors where the colours begin
FAINTEST = 1e-6  # percent


def select(sources: Sequence[Source], settings: Plot) -> list[tuple[str, Balls]]:
    """What the figure shows. Raises ``InvalidValueError`` where every prediction of one evaluation diverged."""
    return [(source.label, balls(source)) for source in sources]


def numbers(shown: Sequence[tuple[str, Balls]]) -> Mapping[str, Array]:
    """Every initial state with its error, of each predictor."""
    return {f"{label}/{name}": array for label, one in shown for name, array in columns(one).items()}


def draw(shown: Sequence[tuple[str, Balls]]) -> Figure:
    """From above and from the side, a column for each predictor; the largest errors on top."""
    errors = np.concatenate([one.rmse for _, one in shown])
    low = max(float(np.quantile(errors, LEAST)), FAINTEST)
    shades = ScalarMappable(LogNorm(low, max([2 * low, *(one.top for _, one in shown)])), SHADES)
    with style():
        figure = Figure(figsize=(0.5 + PANEL * len(shown), 4.9), layout="constrained")
        panels = figure.subplots(2, len(shown), sharex="row", sharey="row", squeeze=False)
        for (label, one), pair in zip(shown, panels.T, strict=True):
            names = [axis_label(n, u) for n, u in zip(one.channels.names, one.channels.units, strict=True)]
            colours = shades.to_rgba(np.maximum(one.rmse, low))
            pair[0].set_title(f"{plain(label)}, mean {one.rmse.mean():.3g} %", fontsize=8)
            for axes, (across, up) in zip(pair, ((0, 1), (1, 2)), strict=True):
                axes.scatter(
                    one.x0[:, across], one.x0[:, up], s=4, color=colours, linewidths=0, zorder=3, rasterized=True
                )
                axes.set_xlabel(names[across])
                if pair[0] is panels[0, 0]:
                    axes.set_ylabel(names[up])
        figure.colorbar(shades, ax=list(panels.ravel()), location="bottom", label="RMSE (%)", extend="both", aspect=35)
    return figure
