"""Units that were guessed from magnitudes, settled by an acceleration in the same log: v r is a_y, dv/dt is a_x."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.logs.clues import Clue, FileClues
from koopcli.logs.measures import FEWEST, slope_of
from koopcli.logs.quantities import UNITS_OF
from koopcli.logs.units import unit
from koopcli.records import FloatArray
from koopcli.text import one_line

STEP = 0.1  # s, of the grid on which signals are compared
SPAN = 5  # steps, over which dv/dt is taken
MOST = 50_000  # rows that are compared
FITS = (0.7, 1.4)  # times as large
REGUESSED = 0.2  # in the logarithm: what each unit that is not the guessed one costs


@dataclass(frozen=True, eq=False)
class _Series:
    clue: Clue
    time: FloatArray
    values: FloatArray


def settled(states: Sequence[Clue], sources: Sequence[FileClues], notes: list[str]) -> list[Clue]:
    """The ``states`` with the units of v_x and yaw_rate under which v_x · yaw_rate is a_y, or dv_x/dt is a_x.

    Units that a file says stay as they are, and so do all where no acceleration is known or none fits. ``notes`` gains
    what was settled.
    """
    clues = {clue.quantity.name: clue for clue in states}
    for names, other in ((("v_x", "yaw_rate"), "a_y"), (("v_x",), "a_x")):
        if not all(name in clues for name in names) or not any(clues[name].guessed for name in names):
            continue
        sides = [series for name in names if (series := _series(clues[name], sources))]
        beside = [series for clue in _accelerations(other, sources) if (series := _series(clue, sources))]
        if len(sides) < len(names) or not beside:
            continue
        units = _units(sides, beside[0])
        if units is None:
            continue
        for name, chosen in zip(names, units[0], strict=True):
            if clues[name].guessed:
                compared = " · ".join(names) if other == "a_y" else "its slope"
                turned = " but for its sign" if units[1] < 0 else ""
                title = one_line(beside[0].clue.title)
                notes.append(f"{name}: unit {chosen}, since {compared} is then '{title}' ({other}){turned}")
                clues[name] = replace(clues[name], unit=chosen, settled=True)
        break
    return [clues[clue.quantity.name] for clue in states]


def _accelerations(name: str, sources: Sequence[FileClues]) -> Iterator[Clue]:
    clues = [clue for file in sources for clue in file.clues if clue.quantity.name == name]
    yield from sorted(clues, key=lambda clue: (clue.beside, len(clue.title)))


def _series(clue: Clue, sources: Sequence[FileClues]) -> _Series | None:
    (file,) = (file for file in sources if file.source == clue.source)
    if file.clock is None:
        return None
    try:
        values = file.table.read([file.table.place(clue.column)])[0]
    except InvalidValueError:
        return None
    time = file.clock.stamps
    values = values[1:] if len(values) == len(time) + 1 else values  # a first row may be left over
    if len(values) != len(time):
        return None
    kept = np.isfinite(values) & np.isfinite(time)
    return _Series(clue, time[kept], values[kept])


def _units(sides: Sequence[_Series], beside: _Series) -> tuple[tuple[str, ...], float] | None:
    """The units of ``sides`` under which they fit ``beside``, and the sign of that fit; None where none do."""
    start, end = (pick(series.time[i] for series in (*sides, beside)) for pick, i in ((max, 0), (min, -1)))
    count = int((end - start) / STEP) if end > start else 0
    if count < FEWEST:
        return None
    grid = start + STEP * np.arange(min(count, MOST))
    columns = [_mean(series, grid) for series in sides]
    second = _mean(beside, grid)
    if len(columns) == 2:
        first = columns[0] * columns[1]
    else:
        first = (columns[0][SPAN:] - columns[0][:-SPAN]) / (SPAN * STEP)
        second = np.convolve(second, np.full(SPAN, 1 / SPAN), "valid")[: len(first)]
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = slope_of(first, second)
    if not np.isfinite(slope) or slope == 0:
        return None
    best: tuple[float, float, tuple[str, ...]] | None = None
    for units in product(*(_choices(series.clue) for series in (*sides, beside))):
        factors = [unit(name).factor for name in units]
        distance = abs(float(np.log(abs(slope) * np.prod(factors[:-1]) / factors[-1])))
        changed = sum(name != series.clue.unit for name, series in zip(units, (*sides, beside), strict=True))
        if best is None or distance + REGUESSED * changed < best[0]:
            best = distance + REGUESSED * changed, distance, units[:-1]
    fits = best is not None and best[1] <= np.log(FITS[1])
    return (best[2], float(np.sign(slope))) if best is not None and fits else None


def _choices(clue: Clue) -> list[str]:
    if not clue.guessed:
        return [clue.unit]
    return [name for name, _ in UNITS_OF[clue.quantity.unit]]


def _mean(series: _Series, grid: FloatArray) -> FloatArray:
    """The means of a signal over the steps of the ``grid`` (k,), (k,): of its integral, so that noise averages out."""
    steps = np.diff(series.time)
    middle = (series.values[1:] + series.values[:-1]) / 2
    integral = np.concatenate([[0.0], np.cumsum(middle * steps)])
    edges = np.append(grid, grid[-1] + STEP)
    return np.asarray(np.diff(np.interp(edges, series.time, integral)) / STEP)
