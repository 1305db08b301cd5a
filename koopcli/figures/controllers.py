"""Several controllers in the same scenarios: settle times and costs side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from koopcli.config.pictures import Plot
from koopcli.control.closed import ClosedLoop
from koopcli.figures.kit.figure import FigureKind, Source, column
from koopcli.figures.kit.style import COLOURS, COLUMN, Figure, plain, style, ticks
from koopcli.records import Array, FloatArray

FIGURE = FigureKind(about="settle times and costs of several closed loops", takes="loop", draws="beside")

ROW, BESIDES = 0.3, 0.7  # inches


@dataclass(frozen=True)
class Bar:
    """One loop: its ``label``, the mean settle time in s of the cars that settled, their ``share``, and the mean J."""

    label: str
    settled: float
    share: float
    cost: float


def select(sources: Sequence[Source], settings: Plot) -> list[Bar]:
    """What the figure shows."""
    return [_bar(source.label, source.records["loop"]) for source in sources]


def _bar(label: str, loop: ClosedLoop) -> Bar:
    done, ran = np.isfinite(loop.settled), np.isfinite(loop.cost)
    settled = float(loop.settled[done].mean()) if done.any() else float("nan")
    return Bar(label, settled, float(done.mean()), float(loop.cost[ran].mean()) if ran.any() else float("nan"))


def numbers(shown: Sequence[Bar]) -> Mapping[str, Array]:
    """Settle times, shares and costs."""
    return {
        "settled": column([bar.settled for bar in shown], "loop", "s"),
        "share": column([bar.share for bar in shown], "loop", "1"),
        "cost": column([bar.cost for bar in shown], "loop", "1"),
    }


def draw(shown: Sequence[Bar]) -> Figure:
    """A bar for each loop in two panels, the first loop on top."""
    places = np.arange(len(shown))[::-1]
    with style():
        figure = Figure(figsize=(COLUMN, ROW * len(shown) + BESIDES), layout="constrained")
        left, right = figure.subplots(1, 2, sharey=True)
        for panel, values, name in (
            (left, [bar.settled for bar in shown], "settled after (s)"),
            (right, [bar.cost for bar in shown], "cost J (1)"),
        ):
            panel.barh(places, _drawn(values), color=COLOURS[0], height=0.6)
            panel.set_xlabel(name)
            panel.set_xlim(left=0)
            ticks(panel.xaxis, 4)
            panel.grid(axis="y", visible=False)
        left.set_yticks(places, [_named(bar) for bar in shown])
    return figure


def _named(bar: Bar) -> str:
    return plain(bar.label) if bar.share == 1 else f"{plain(bar.label)}, {100 * bar.share:.0f} % settle"


def _drawn(values: Sequence[float]) -> FloatArray:
    return np.asarray(np.nan_to_num(np.asarray(values, dtype=float)))
