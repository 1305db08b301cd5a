"""Names at the ends of lines, where others have a legend: apart from one another, each as near to its end as can be."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from textwrap import fill
from typing import Any

import numpy as np

from koopcli.figures.kit.style import LINE, SMALLEST, Axes
from koopcli.records import FloatArray

WIDEST = 17  # letters of a name in a line
AWAY, GAP = 0.11, 0.015  # of the width of the panel: what leads from the end of a line to its name, and before that


@dataclass(frozen=True)
class End:
    """Where a line ends, ``at`` in the units of its axis, and its ``name``, written in ``colour``; ``look``: of the
    line that leads from there to the name.
    """

    at: float
    name: str
    colour: str
    look: Mapping[str, Any]
    weight: str = "normal"


def room_for(names: Sequence[str]) -> float:
    """The height in inches that the ``names`` take, one below the other."""
    return sum(LINE * (_wrapped(name).count("\n") + 1) for name in names) + LINE / 4 * len(names)


def name_ends(axes: Axes, ends: Sequence[End], height: float) -> None:
    """Write the names to the right of ``axes``, whose panel is ``height`` inches high and has its limits already."""
    from matplotlib.lines import Line2D

    texts = [_wrapped(end.name) for end in ends]
    heights = np.array([room_for([end.name]) for end in ends]) / height
    to_axes = axes.transData + axes.transAxes.inverted()
    wanted = np.array([to_axes.transform((axes.get_xlim()[1], end.at))[1] for end in ends])
    for end, text, at, y in zip(ends, texts, np.clip(wanted, 0, 1), apart(wanted, heights), strict=True):
        leader = Line2D([1, 1 + AWAY], [at, y], transform=axes.transAxes, clip_on=False, **end.look)
        axes.add_artist(leader)
        look: dict[str, Any] = {"color": end.colour, "fontsize": SMALLEST, "fontweight": end.weight}
        axes.text(1 + AWAY + GAP, y, text, transform=axes.transAxes, va="center", linespacing=1.05, **look)


def apart(wanted: FloatArray, heights: FloatArray) -> FloatArray:
    """Places (n,) between 0 and 1 as near to those ``wanted`` as boxes of these ``heights`` in their order let them be.

    Neighbours that would overlap become one block about the mean of what they want; what leaves one end goes back.
    """
    order = np.argsort(wanted, kind="stable")
    below = np.cumsum(heights[order]) - heights[order] / 2  # of each box's middle when all stand on zero
    blocks: list[list[float]] = []  # the mean of what the boxes of a block want above that, and how many they are
    for want in wanted[order] - below:
        blocks.append([want, 1])
        while len(blocks) > 1 and blocks[-2][0] > blocks[-1][0]:
            mean, count = blocks.pop()
            before, many = blocks[-1]
            blocks[-1] = [(before * many + mean * count) / (many + count), many + count]
    lifted = np.concatenate([np.full(int(count), mean) for mean, count in blocks])
    places = np.empty(len(wanted))
    places[order] = np.clip(lifted, 0, max(0.0, 1 - float(heights.sum()))) + below
    return places


def _wrapped(name: str) -> str:
    return fill(name, WIDEST)
