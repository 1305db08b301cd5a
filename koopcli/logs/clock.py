"""The time of a source: read as the map says, then mended or refused."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.logs.dates import DateError, seconds_of
from koopcli.logs.entries import Source
from koopcli.logs.formats.table import Table
from koopcli.logs.units import known, unit
from koopcli.records import FloatArray, IndexArray


@dataclass(frozen=True, eq=False)
class Clock:
    """The ``time`` (m,) in s of the ``rows`` (m,) of a source that count, rising throughout.

    ``repeated``: rows left out since a later one has their time; ``first``: whether a first row was left out that is
    later than the second one; ``untimed``: rows without a time.
    """

    time: FloatArray
    rows: IndexArray
    repeated: int = 0
    first: bool = False
    untimed: int = 0


def time_columns(source: Source, table: Table) -> list[int]:
    """The numbers of the columns of a ``table`` that hold the time as numbers; none for a rate, a date or stamps."""
    time = source.time
    if time.s is not None:
        return [table.place(column) for column in (time.s, time.ns) if column is not None]
    if time.rate is not None or time.format or (time.column is None and table.stamps is not None):
        return []
    column = table.time_place() if time.column is None else table.place(time.column)
    if column is None or (time.column is None and not time.file and len(table.names) == 1):
        raise InvalidValueError(
            f"{table.path}: source.{source.name} has no time: say time = {{ column = ... }}, {{ rate = ... }} (Hz) or "
            "{ file = ... } in the map"
        )
    return [column]


def times_of(source: Source, table: Table, rows: int, place: int) -> FloatArray:
    """The time in s (rows,) as the file has it, plus the offset of the source.

    ``table``: the file that holds the time; ``rows`` and ``place``: of a column that is mapped, for a rate and for
    formats whose columns have times of their own. Raises ``InvalidValueError`` for a time that cannot be read.
    """
    time = source.time
    if time.rate is not None:
        return np.arange(rows) / time.rate + source.offset
    if time.column is None and time.s is None and table.stamps is not None:
        return table.stamps(place) + source.offset
    if time.format:
        if table.words is None:
            raise InvalidValueError(f"{table.path}: time.format is for text: say time = {{ column, unit }}")
        return _dates(table, 0 if time.column is None else table.place(time.column), time.format) + source.offset
    columns = time_columns(source, table)
    values = table.read(columns)
    if time.s is not None:
        return np.asarray(values[0] + (values[1] * 1e-9 if time.ns is not None else 0.0) + source.offset)
    said = time.unit or table.units[columns[0]]
    measured = unit(said) if known(said) else unit("s")
    return np.asarray(values[0] * (measured.factor if measured.si == "s" else 1.0) + source.offset)


def mended(time: FloatArray, where: Callable[[int], str]) -> Clock:
    """The rows that count of a ``time`` (n,): of those with one time the last, and no first row left over.

    ``where``: the place of a row, for errors. Raises ``InvalidValueError`` for a time that goes back or never moves.
    """
    rows = np.flatnonzero(np.isfinite(time))
    if not len(rows):
        raise InvalidValueError(f"{where(0)}: no row has a time: numbers were expected, say another time in the map")
    untimed = len(time) - len(rows)
    first = bool(len(rows) > 2 and time[rows[1]] < time[rows[0]])
    rows = rows[1:] if first else rows
    steps = np.diff(time[rows])
    if (steps < 0).any():
        back = int(rows[int(np.argmax(steps < 0)) + 1])
        raise InvalidValueError(
            f"{where(back)}: time goes back by {-steps.min():.6g} s: it must rise, split the file or map another time"
        )
    if not len(steps):
        raise InvalidValueError(f"{where(int(rows[0]))} is the only row with a time: more were expected")
    if not (steps > 0).any():
        raise InvalidValueError(f"{where(0)}: time never moves over {len(rows)} rows: map another time")
    last = np.append(steps > 0, True)
    return Clock(time[rows[last]], rows[last], int((~last).sum()), first, untimed)


def place_in(table: Table) -> Callable[[int], str]:
    """What names a row of a table in an error."""

    def where(row: int) -> str:
        path: Path = table.path
        return f"{path}, line {table.line(row)}" if table.line is not None else f"{path}, row {row}"

    return where


def _dates(table: Table, column: int, layout: str) -> FloatArray:
    assert table.words is not None
    texts = table.words(column)
    try:
        return seconds_of(texts, layout)
    except DateError as error:
        raise InvalidValueError(
            f"{place_in(table)(error.row)}: the time '{texts[error.row][:40]}' is not written as '{layout}': mend "
            "format in the map"
        ) from None
