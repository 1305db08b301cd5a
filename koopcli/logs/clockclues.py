"""Which column of a file is its time, and in which unit."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.logs.dates import DateError, seconds_of
from koopcli.logs.formats import open_table
from koopcli.logs.formats.table import Table
from koopcli.logs.quantities import unit_in, words_of
from koopcli.logs.units import known, unit
from koopcli.records import FloatArray

TIMES = frozenset(
    "t time timestamp timestamps stamp times sec secs seconds utc clock elapsed epoch date datetime".split()  # noqa: SIM905
)
FORMATS = ("%Y_%m_%d_%H_%M_%S_%f", "%Y-%m-%d %H:%M:%S.%f", "%Y-%m-%dT%H:%M:%S.%f", "%Y-%m-%d %H:%M:%S", "%H:%M:%S.%f")
EPOCHS = (("ns", 1e17), ("us", 1e14), ("ms", 1e11), ("s", 1e8))  # units of times that count from 1970
STEPS = (("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9))  # and of others, whose steps are between 1 ms and 1 s
RISING = 8  # columns without the name of a time that are looked at for one


@dataclass(frozen=True, eq=False)
class Clock:
    """The time of a source: ``toml`` as a map writes it, "" where nothing has to be said, and ``stamps`` (rows,) in s.

    ``doubt``: what of it was guessed.
    """

    toml: str
    stamps: FloatArray
    doubt: str = ""

    @property
    def step(self) -> float:
        """The median step in s."""
        steps = np.diff(self.stamps)
        return float(np.median(steps[steps > 0])) if (steps > 0).any() else np.nan

    def gaps(self, longest: float) -> FloatArray:
        """The silences in s that are longer than ``longest`` s and than five steps."""
        steps = np.diff(self.stamps)
        return np.asarray(steps[steps > max(longest, 5 * self.step)])


def numbers(table: Table, place: int) -> FloatArray | None:
    """The finite numbers of a column; None where it has fewer than two, or holds text."""
    try:
        values = table.read([place])[0]
    except InvalidValueError:
        return None
    finite = values[np.isfinite(values)]
    return finite if len(finite) > 1 else None


def clock_of(table: Table, path: Path, beside: Sequence[Path], taken: set[int], inside: bool = False) -> Clock | None:
    """The clock of the file at ``path``, None where there is no time; ``taken`` gains the columns that it takes.

    ``beside``: all files of the log, one of which may hold the time; ``inside``: whether the map names its folder.
    """
    if table.stamps is not None:
        return Clock("", _without_leftover(table.stamps(0)))
    lowered = [name.lower() for name in table.names]
    if "s" in lowered and "ns" in lowered:
        places = [lowered.index("s"), lowered.index("ns")]
        taken.update(places)
        s, ns = table.read(places)
        names = [json.dumps(table.names[place], ensure_ascii=False) for place in places]
        return Clock(f"{{ s = {names[0]}, ns = {names[1]} }}", _without_leftover(s + 1e-9 * ns))
    named = [place for place, name in enumerate(table.names) if set(unit_in(name)[0].split("_")) & TIMES]
    unnamed = [place for place in range(len(table.names)) if place not in named]
    for place in (*named, *unnamed[:RISING]):
        clock = _clock_of(table, place, place in named)
        if clock is not None:
            taken.update({place, *named})
            return clock
    return _beside(path, beside, inside)


def _clock_of(table: Table, place: int, named: bool) -> Clock | None:
    """The clock that a column is; None where it does not go forward, or only counts rows."""
    name = table.names[place]
    column = json.dumps(name, ensure_ascii=False) if name and table.names.count(name) == 1 else str(place)
    values = numbers(table, place)
    if values is None:
        return _written(table, place, column)
    stamps = _without_leftover(values)
    steps = np.diff(stamps)
    if not len(steps) or (steps < 0).any() or (steps > 0).mean() < (0.02 if named else 0.98):
        return None
    if not named and ((steps == 1).all() or not len(np.unique(stamps)) > 2):
        return None
    stated = table.units[place] or (words_of(name) or ("",))[-1]
    told = known(stated) and unit(stated).si == "s"
    written = unit(stated).name if told else _unit_of_times(stamps)
    doubts = [] if named else [f"taken as the time since it only rises: {name or place}"]
    doubts += [] if told or (named and written == "s") else [f"{written} guessed from its size"]
    toml = f'{{ column = {column}, unit = "{written}" }}'
    return Clock(toml, stamps * unit(written).factor, "; ".join(doubts))


def _unit_of_times(stamps: FloatArray) -> str:
    for name, least in EPOCHS:
        if stamps[0] > least:
            return name
    steps = np.diff(stamps)
    step = float(np.median(steps[steps > 0]))
    return next((name for name, factor in STEPS if step <= factor), "ns")


def _written(table: Table, place: int, column: str) -> Clock | None:
    """The clock of a column of dates."""
    words = table.words(place) if table.words is not None else []
    for pattern in FORMATS if len(words) > 1 else ():
        try:
            stamps = seconds_of(words, pattern)
        except DateError:
            continue
        return Clock(f'{{ column = {column}, format = "{pattern}" }}', _without_leftover(stamps - stamps[0]))
    return None


def _beside(path: Path, beside: Sequence[Path], inside: bool) -> Clock | None:
    """The clock of a file that lies beside and is named after the time."""
    for other in beside:
        if other.parent != path.parent or other == path or other.stem.lower() not in TIMES:
            continue
        values = numbers(open_table(other), 0)
        if values is None or np.any(np.diff(_without_leftover(values)) < 0):
            continue
        stamps = _without_leftover(values)
        written = _unit_of_times(stamps)
        ending = json.dumps(f"{other.parent.name}/{other.name}" if inside else other.name, ensure_ascii=False)
        said = "" if written == "s" else f', unit = "{written}"'
        return Clock(f"{{ file = {ending}{said} }}", stamps * unit(written).factor)
    return None


def _without_leftover(stamps: FloatArray) -> FloatArray:
    """Times without a first one that is later than the second: it is left over from the last run."""
    return stamps[1:] if len(stamps) > 2 and stamps[0] > stamps[1] else stamps
