"""RMSE over a grid of settings: one on the axis, the others a curve each, seeds a band."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from koopcli.config.pictures import Plot
from koopcli.errors import InvalidValueError
from koopcli.figures.kit.figure import FigureKind, Source, column
from koopcli.figures.kit.style import COLUMN, Figure, legend_below, looks, plain, plain_numbers, style, ticks
from koopcli.koopman.scores.swept import REPEATS, Swept
from koopcli.records import Array, FloatArray

FIGURE = FigureKind(
    about="RMSE over a swept grid of settings",
    takes="sweep",
    only="fit-edmd",
    instead="it sweeps reproduce.orders over reproduce.draw_seeds; koop sweep sweeps anything",
)

MOST = 12  # curves that can be told apart
WIDE = 100  # ratio of the ends of an axis from which on it is logarithmic
STEEP = 10  # the same of errors


@dataclass(frozen=True)
class Curve:
    """Along the axis at ``at`` (m,): the median of the mean errors in percent over all seeds, and their ends."""

    label: str
    at: FloatArray
    middle: FloatArray
    low: FloatArray
    high: FloatArray


@dataclass(frozen=True)
class SweptErrors:
    """Curves against the setting ``name``, whose values are ``words`` where they are no numbers; ``left_out``: how many
    curves with larger errors are not shown, ``seeds``: the most in one place.
    """

    name: str
    words: tuple[str, ...]
    curves: tuple[Curve, ...]
    left_out: int
    seeds: int


def select(sources: Sequence[Source], settings: Plot) -> SweptErrors:
    """What the figure shows. Raises ``InvalidValueError`` where every prediction of every cell diverged."""
    table: Swept = sources[0].records["sweep"]
    mean = table.scores["mean"]
    if not np.isfinite(mean).any():
        raise InvalidValueError("every prediction of this sweep diverged: there is no error to draw")
    axis = _axis(table)
    at, words = _positions(table.values[axis])
    kept = [i for i, name in enumerate(table.names) if i != axis and name.rpartition(".")[2] != REPEATS]
    groups: dict[tuple[int, ...], dict[float, list[float]]] = {}
    for place, error in zip(table.places.tolist(), mean.tolist(), strict=True):
        points = groups.setdefault(tuple(place[i] for i in kept), {})
        for spot in at if place[axis] < 0 else at[[place[axis]]]:  # where it has no effect a curve is flat
            points.setdefault(float(spot), []).append(error)
    curves = [_curve(_label(table, kept, place), points) for place, points in groups.items()]
    worth = {i: float(np.nanmin(c.middle)) for i, c in enumerate(curves) if np.isfinite(c.middle).any()}
    best = sorted(sorted(worth, key=worth.__getitem__)[:MOST])
    seeds = max(len(errors) for points in groups.values() for errors in points.values())
    return SweptErrors(table.names[axis], words, tuple(curves[i] for i in best), len(curves) - len(best), seeds)


def numbers(shown: SweptErrors) -> Mapping[str, Array]:
    """Where each curve has points, the median over seeds, the least and the largest."""
    columns: dict[str, Array] = {}
    for curve in shown.curves:
        front = f"{curve.label}/" if curve.label else ""
        columns[f"{front}{shown.name}"] = column(curve.at, "point", "place" if shown.words else "as set")
        for name in ("middle", "low", "high"):
            columns[f"{front}{name}"] = column(getattr(curve, name), "point", "%")
    return columns


def draw(shown: SweptErrors) -> Figure:
    """A curve for each combination of the other settings, with a band from the best seed to the worst."""
    with style():
        figure = Figure(figsize=(COLUMN, 2.7), layout="constrained")
        axes = figure.subplots()
        for i, (curve, look) in enumerate(zip(shown.curves, looks(len(shown.curves)), strict=True)):
            label = plain(curve.label) or ("median over seeds" if shown.seeds > 1 else "mean over trajectories")
            axes.plot(curve.at, curve.middle, marker="o", label=label, **look)
            if shown.seeds > 1:
                band = "from the best seed to the worst" if i == len(shown.curves) - 1 else None
                axes.fill_between(curve.at, curve.low, curve.high, color=look["color"], alpha=0.2, lw=0, label=band)
        high = np.concatenate([curve.high for curve in shown.curves])
        low = np.concatenate([curve.low for curve in shown.curves])
        if 0 < STEEP * np.nanmin(low) < np.nanmax(high):
            axes.set_yscale("log")
            plain_numbers(axes.yaxis)
        _along(axes, shown)
        axes.set_xlabel(f"{shown.name} (as set)")
        axes.set_ylabel("RMSE (%)")
        legend_below(figure, title=f"the {MOST} best of {MOST + shown.left_out}" if shown.left_out else None)
    return figure


def _along(axes: Any, shown: SweptErrors) -> None:
    """The horizontal axis: words at their places, whole numbers, or powers of ten where values go far."""
    at = np.unique(np.concatenate([curve.at for curve in shown.curves]))
    if shown.words:
        axes.set_xticks(range(len(shown.words)), [plain(word) for word in shown.words])
    elif at[0] >= 0 and at[-1] > WIDE * (least := at[at > 0][0]):
        axes.set_xscale("symlog", linthresh=least) if at[0] == 0 else axes.set_xscale("log")
    elif (at == np.round(at)).all():
        ticks(axes.xaxis, integer=True)


def _axis(table: Swept) -> int:
    """The axis that the others are drawn along: the one with the most numbers, else the first; a seed only if alone."""
    draws = [name.rpartition(".")[2] == REPEATS for name in table.names]

    def rank(i: int) -> tuple[bool, bool, int, int]:
        return (not draws[i], _numeric(table.values[i]), len(table.values[i]), -i)

    return max(range(len(table.names)), key=rank)


def _positions(values: Sequence[str]) -> tuple[FloatArray, tuple[str, ...]]:
    """Where values stand on the axis, and what is written there where they are no numbers."""
    if _numeric(values):
        return np.array([float(value) for value in values]), ()
    return np.arange(float(len(values))), tuple(values)


def _numeric(values: Sequence[str]) -> bool:
    try:
        return bool(np.isfinite([float(value) for value in values]).all())
    except ValueError:
        return False


def _curve(label: str, points: Mapping[float, Sequence[float]]) -> Curve:
    at = np.array(sorted(points))
    groups = [[error for error in points[spot] if np.isfinite(error)] or [np.nan] for spot in at]
    return Curve(label, at, *(np.array([f(errors) for errors in groups]) for f in (np.median, min, max)))


def _label(table: Swept, kept: Sequence[int], place: Sequence[int]) -> str:
    """The settings of a curve by the last of their names, or by all of it where that is another's too."""
    last = [name.rpartition(".")[2] for name in table.names]
    names = [short if last.count(short) == 1 else name for short, name in zip(last, table.names, strict=True)]
    return ", ".join(f"{names[i]} {table.values[i][p]}" for i, p in zip(kept, place, strict=True) if p >= 0)
