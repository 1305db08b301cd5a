"""Where the errors are: every initial state as a ball whose size and colour is the RMSE of its trajectory."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from koopcli.config.pictures import Plot
from koopcli.figures.balls import Balls, balls, columns
from koopcli.figures.colours import SHADES
from koopcli.figures.drawing import Source
from koopcli.figures.style import COLUMN, axis_label, in_space, style
from koopcli.records import Array

PALEST = 0.2  # opacity of a ball without error


def select(sources: Sequence[Source], settings: Plot) -> Balls:
    """What the figure shows. Raises ``InvalidValueError`` where every prediction diverged."""
    return balls(sources[0])


def numbers(shown: Balls) -> Mapping[str, Array]:
    """Every initial state with its error."""
    return columns(shown)


def draw(shown: Balls) -> Figure:
    """The first three states in space, the paler the smaller the error; and from above, the largest errors on top."""
    names = [axis_label(n, u) for n, u in zip(shown.channels.names, shown.channels.units, strict=True)]
    shades = ScalarMappable(Normalize(0, shown.top), SHADES)
    colours = shades.to_rgba(shown.rmse)
    through = np.column_stack([colours[:, :3], PALEST + (1 - PALEST) * np.clip(shown.rmse / shown.top, 0, 1)])
    with style():
        figure = Figure(figsize=(COLUMN, 6.2), layout="constrained")
        space = figure.add_subplot(2, 1, 1, projection="3d")
        space.scatter(*shown.x0[:, :3].T, s=shown.sizes, color=through, depthshade=False, linewidths=0, rasterized=True)
        in_space(space, names, zoom=1.0)
        above = figure.add_subplot(2, 1, 2)
        above.scatter(
            shown.x0[:, 0], shown.x0[:, 1], s=shown.sizes, color=colours, linewidths=0, zorder=3, rasterized=True
        )
        if len(set(shown.channels.units[:2])) == 1:
            above.set_aspect("equal", adjustable="datalim")
        above.set_xlabel(names[0])
        above.set_ylabel(names[1])
        bar: dict[str, Any] = {
            "location": "bottom",
            "label": "RMSE (%)",
            "extend": shown.beyond,
            "shrink": 0.8,
            "aspect": 35,
        }
        figure.colorbar(shades, ax=above, **bar)
    return figure
