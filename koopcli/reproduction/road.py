"""Ghosts on the road: a drawing that stands by itself, and what a slider needs to move it."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from html import escape

import numpy as np

from koopcli.records import FloatArray
from koopcli.reproduction.ghosts import LOST, Shown, Track
from koopcli.reproduction.texts import number_text

COLOURS = ("#1b1f24", "#d55e00", "#0072b2")  # the true car, and ghosts
OVERHANG, HALF_WIDTH = 0.8, 0.9  # m, of a car beyond its axles, and to either side
MARGIN = 0.5  # m around
DECIMALS = 3


def road(shown: Shown) -> Iterator[str]:
    """The drawing with its legend and what is said of it, and the numbers for a slider."""
    low, high = _extent(shown)
    box = f"{low[0]:.2f} {-high[1]:.2f} {high[0] - low[0]:.2f} {high[1] - low[1]:.2f}"
    yield '<div class="ghosts" id="ghosts">'
    yield f'<svg viewBox="{box}" role="img" aria-label="{escape(said(shown))}">'
    yield f'<path class="grid" d="{_grid(low, high)}"/>'
    order = [*range(1, len(shown.tracks)), 0]  # the true car on top
    for i in order:
        dashes = f' stroke-dasharray="{0.5 - 0.15 * i:.2f} 0.2"' if i else ""
        yield f'<path class="way" stroke="{COLOURS[i]}"{dashes} d="{_line(shown.tracks[i].path)}"/>'
    for i in order:
        yield _car(shown, i)
    yield '</svg><ul class="legend">'
    for i, track in enumerate(shown.tracks):
        off = f' <span class="off">{off_text(track, shown.dt)}</span>' if i else ""
        yield f'<li><i style="background:{COLOURS[i]}"></i>{escape(track.label)}{off}</li>'
    yield f"</ul><p>{escape(said(shown))}</p>"
    cars = [np.round(track.path, DECIMALS).ravel().tolist() for track in shown.tracks]
    far = [np.round(track.off, DECIMALS).tolist() for track in shown.tracks]
    data = json.dumps({"dt": shown.dt, "cars": _known(cars), "off": _known(far)}, allow_nan=False)
    yield f'<script type="application/json">{data}</script></div>'


def said(shown: Shown) -> str:
    """What drives the cars, and how far each ghost ends from the true one."""
    ends = "; ".join(f"{track.label} is {off_text(track, shown.dt)}{_most(track)}" for track in shown.tracks[1:])
    seconds = (len(shown.tracks[0].off) - 1) * shown.dt
    about = f"The true car and its ghosts over {seconds:.3g} s: {shown.inputs}. At the end {ends}."
    return f"{about} Grid lines are 1 m apart."


def off_text(track: Track, dt: float) -> str:
    """How far a ghost is off at the end, or when it was lost."""
    samples = int(np.isfinite(track.off).sum())
    if samples == len(track.off):
        return f"{number_text(float(track.off[-1]))} m off"
    return f"more than {LOST:g} m off after {samples * dt:.2f} s"


def _most(track: Track) -> str:
    """How far a ghost was off on the way, where that is more."""
    if np.isnan(track.off).any() or track.off.max() <= 1.01 * track.off[-1]:
        return ""
    return f" (at most {number_text(float(track.off.max()))} m)"


def _extent(shown: Shown) -> tuple[FloatArray, FloatArray]:
    """The corners (2,) of what is drawn: the bodies of all cars along their paths, which may spin."""
    x, y, heading = np.concatenate([track.path for track in shown.tracks]).T
    long = max(shown.vehicle.l_f, shown.vehicle.l_r) + OVERHANG
    cos, sin = np.abs(np.cos(heading)), np.abs(np.sin(heading))
    reach = np.stack([long * cos + HALF_WIDTH * sin, long * sin + HALF_WIDTH * cos], axis=1) + MARGIN
    places = np.stack([x, y], axis=1)
    return np.nanmin(places - reach, axis=0), np.nanmax(places + reach, axis=0)


def _grid(low: FloatArray, high: FloatArray) -> str:
    """Lines a metre apart."""
    across = [f"M{a} {-high[1]:.2f}V{-low[1]:.2f}" for a in range(math.ceil(low[0]), math.floor(high[0]) + 1)]
    along = [f"M{low[0]:.2f} {-b}H{high[0]:.2f}" for b in range(math.ceil(low[1]), math.floor(high[1]) + 1)]
    return "".join([*across, *along])


def _line(path: FloatArray) -> str:
    points = [f"{x:.2f} {-y:.2f}" for x, y, _ in path[np.isfinite(path).all(axis=1)]]
    return f"M{'L'.join(points)}" if points else ""


def _car(shown: Shown, i: int) -> str:
    """A car where its track ends; one that is lost by then is where it was last."""
    track, p = shown.tracks[i], shown.vehicle
    x, y, heading = track.path[np.isfinite(track.off)][-1]
    rear, length = -p.l_r - OVERHANG, p.l_f + p.l_r + 2 * OVERHANG
    place = f"translate({x:.3f} {-y:.3f}) rotate({-math.degrees(heading):.2f})"
    body = f'<rect x="{rear:.2f}" y="{-HALF_WIDTH}" width="{length:.2f}" height="{2 * HALF_WIDTH}" rx=".35"/>'
    glass = f'<rect x="{p.l_f - 0.7:.2f}" y="-.7" width=".6" height="1.4" rx=".2" fill="#fff" fill-opacity=".7"/>'
    return f'<g class="car" data-car="{i}" fill="{COLOURS[i]}" transform="{place}">{body}{glass}</g>'


def _known(rows: list[list[float]]) -> list[list[float | None]]:
    return [[value if math.isfinite(value) else None for value in row] for row in rows]
