"""What a file of a log seems to hold: which columns are the time, which are signals, and in which units."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.logs.clockclues import TIMES, Clock, clock_of, numbers
from koopcli.logs.entries import Column
from koopcli.logs.formats import open_table
from koopcli.logs.formats.table import Table
from koopcli.logs.quantities import BY_NAME as QUANTITY
from koopcli.logs.quantities import COMMANDS, Quantity, quantity_of, unit_by_magnitude, unit_in, words_of
from koopcli.logs.units import known, unit
from koopcli.records import FloatArray

PRESSURE = frozenset(("pressure", "p", "pbrake"))
GENERIC = TIMES | {"value", "values", "data", "log", "samples"}
IDLE = 0.02  # of the largest magnitude


@dataclass(frozen=True, eq=False)
class Clue:
    """A column that seems to be a ``quantity``: where it is, its ``unit`` and whether that was guessed.

    ``beside``: how many words its name has that do not say so; ``largest``: 99.9 % of its magnitude, as logged;
    ``idle``: the share of rows below ``IDLE`` of that; ``settled``: whether other columns agree with the unit.
    """

    quantity: Quantity
    source: str
    column: Column
    title: str
    unit: str
    guessed: bool
    beside: int
    largest: float
    idle: float
    settled: bool = False

    @property
    def magnitude(self) -> float:
        """99.9 % of its magnitude in SI."""
        return self.largest * unit(self.unit).factor if self.unit else self.largest


@dataclass(frozen=True, eq=False)
class FileClues:
    """A file under the name that a map could give it as a source, with the end of its path that the map names."""

    path: Path
    source: str
    ending: str
    table: Table
    clock: Clock | None
    clues: list[Clue] = field(default_factory=list)
    constant: list[str] = field(default_factory=list)


def look_at(path: Path, beside: Sequence[Path]) -> FileClues:
    """The clues in one file; ``beside``: all files of the log, one of which may hold its time.

    Raises ``InvalidValueError`` for a file that cannot be read.
    """
    table = open_table(path)
    inside = path.stem.lower() in GENERIC and bool(path.parent.name) and not _in_runs(path, beside)
    name = path.parent.name if inside else path.stem
    ending = f"{path.parent.name}/{path.name}" if inside else path.name
    source = "_".join(words_of(name)) or "log"
    taken: set[int] = set()
    clock = clock_of(table, path, beside, taken, inside)
    clues = FileClues(path, source, ending, table, clock)
    commanded = bool(set(words_of(name)) & set(COMMANDS.split()))
    meanings = {}
    for place in range(len(table.names)):
        title = _title(table, place, source)
        meaning = _meaning(title)
        if meaning is not None and place not in taken:
            meanings[place] = title, *meaning
    for place, values in _several(table, list(meanings)).items():
        title, quantity, beside_it = meanings[place]
        if commanded and quantity.kind == "state":
            if quantity.name != "v_x":
                continue
            quantity = QUANTITY["v_command"]
        if np.ptp(values) == 0:
            clues.constant.append(title)
        elif clue := _clue(clues, place, title, quantity, beside_it, values):
            clues.clues.append(clue)
    return clues


def _in_runs(path: Path, beside: Sequence[Path]) -> bool:
    """Whether a file lies in one of several folders whose names differ in numbers alone, each with such a file."""
    bare = re.sub(r"\d+", "", path.parent.name)
    alike = {other.parent for other in beside if other.name == path.name}
    return len([folder for folder in alike if re.sub(r"\d+", "", folder.name) == bare != folder.name]) > 1


def _meaning(title: str) -> tuple[Quantity, int] | None:
    """What a column's title means: as a whole, or by what follows its last ``/`` or point, whichever is surer."""
    parts = (title, title.rpartition("/")[2], title.rpartition(".")[2])
    meanings = [meaning for meaning in map(quantity_of, parts) if meaning is not None]
    return min(meanings, key=lambda meaning: meaning[1]) if meanings else None


def _clue(clues: FileClues, place: int, title: str, quantity: Quantity, beside: int, values: FloatArray) -> Clue | None:
    """What the ``values`` of a column say; None where its unit is not one of the ``quantity``."""
    table = clues.table
    largest = float(np.percentile(np.abs(values), 99.9))
    stated = table.units[place] if known(table.units[place]) else unit_in(title)[1]
    if stated and unit(stated).si != quantity.unit and quantity.kind != "input":
        return None
    name = table.names[place]
    wanted = "Pa" if quantity.name == "brake" and PRESSURE & set(words_of(title)) else quantity.unit
    return Clue(
        quantity,
        clues.source,
        column=name if name and table.names.count(name) == 1 else place,
        title=title,
        unit=unit(stated).name if stated else unit_by_magnitude(wanted, largest),
        guessed=not stated,
        beside=beside,
        largest=largest,
        idle=float((np.abs(values) < IDLE * largest).mean()),
    )


def _title(table: Table, place: int, source: str) -> str:
    """What a column is called: by itself, by its file where it has no name, with an axis where it is one of three."""
    name = table.names[place]
    alike = [other for other in range(len(table.names)) if table.names[other] == name]
    if not name and len(alike) < len(table.names):
        return ""
    title = name or source
    return f"{title}_{'xyz'[alike.index(place)]}" if len(alike) == 3 else title


def _several(table: Table, places: list[int]) -> dict[int, FloatArray]:
    """The finite numbers of columns, read together; without those that hold text or fewer than two numbers."""
    try:
        columns = dict(zip(places, table.read(places), strict=True)) if places else {}
    except InvalidValueError:
        columns = {place: values for place in places if (values := numbers(table, place)) is not None}
    finite = {place: values[np.isfinite(values)] for place, values in columns.items()}
    return {place: values for place, values in finite.items() if len(values) > 1}
