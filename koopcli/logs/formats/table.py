"""The columns of a file of a log, whatever its format: names and units first, values when they are asked for."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from types import ModuleType

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.logs.entries import Column
from koopcli.logs.text import split_unit
from koopcli.logs.values import near
from koopcli.records import FloatArray

TIMES = ("t", "time", "timestamp", "timestamps", "times", "time_s")
WIDEST = 64  # columns of one array


@dataclass(frozen=True, eq=False)
class Table:
    """The columns of a file by number.

    ``names`` and ``units``, one for each column, "" for what has none; ``read``: the values of some columns, each
    (rows,); ``words``: one column as text; ``stamps``: the time in s of a column's own rows, where a format has that;
    ``line``: the line of a row, where a format has lines; ``ordered``: whether "column 0" means anything.
    """

    path: Path
    names: tuple[str, ...]
    units: tuple[str, ...]
    read: Callable[[Sequence[int]], list[FloatArray]]
    words: Callable[[int], list[str]] | None = None
    stamps: Callable[[int], FloatArray] | None = None
    line: Callable[[int], int] | None = None
    ordered: bool = True

    def place(self, column: Column) -> int:
        """The number of a column, from 0, by its name without a unit, by "z#4", the fourth z, or by its number.

        Raises ``InvalidValueError`` for one that is not there, and for a name that several columns have.
        """
        if isinstance(column, int):
            if column < len(self.names):
                return column
            raise InvalidValueError(
                f"{self.path} has {len(self.names)} columns, number {column}, counted from 0, is none: map another"
            )
        places = [place for place, name in enumerate(self.names) if name == column]
        if len(places) == 1:
            return places[0]
        if places:
            raise InvalidValueError(
                f"{self.path} has {len(places)} columns '{column}': write '{column}#1' to '{column}#{len(places)}', or "
                "a number counted from 0"
            )
        return self._numbered(column)

    def _numbered(self, column: str) -> int:
        name, mark, count = column.rpartition("#")
        places = [place for place, each in enumerate(self.names) if each == name] if mark and count.isdigit() else []
        if places and 0 < int(count) <= len(places):
            return places[int(count) - 1]
        if places:
            raise InvalidValueError(f"{self.path} has {len(places)} columns '{name}': '{column}' is none of them")
        bare, _ = split_unit(column.lstrip("#% "))
        if bare != column and bare in self.names:
            return self.place(bare)
        names = list(dict.fromkeys(name for name in self.names if name))
        raise InvalidValueError(f"{self.path} has no column '{column}': {near(column, names)}")

    def of_axis(self, column: Column | None, axis: int) -> int:
        """The number of the column of one ``axis``, 0 to 2, of the vector ``column``; None for the file's only one."""
        if column is None:
            return self.place(axis)
        if isinstance(column, int):
            return self.place(column + axis)
        endings = (f"#{axis + 1}", *(f"{mark}{'xyz'[axis]}" for mark in ("", "_", ".", " ", "/")))
        for ending in endings:
            if ending[0] == "#" and self.names.count(column) != 3:
                continue
            if ending[0] == "#" or column + ending in self.names:
                return self.place(column + ending)
        raise InvalidValueError(f"{self.path} has no axis {'xyz'[axis]} of '{column}': name its column instead")

    def time_place(self) -> int | None:
        """The column of the time where the map does not say it: the first, or that with such a name; None for none."""
        if self.ordered:
            return 0
        named = [place for place, name in enumerate(self.names) if name.rpartition("/")[2].casefold() in TIMES]
        return named[0] if len(named) == 1 else None


def arrays_table(path: Path, arrays: dict[str, np.ndarray], units: dict[str, str] | None = None) -> Table:
    """The table of named arrays in memory, as :func:`shaped_table`."""

    def column(name: str, place: int, turned: bool) -> np.ndarray:
        values = arrays[name]
        return values if values.ndim == 1 else values[place] if turned else values[:, place]

    shapes = {name: values.shape for name, values in arrays.items() if values.dtype.kind in "fiub"}
    return shaped_table(path, shapes, column, units or {})


def shaped_table(
    path: Path,
    shapes: Mapping[str, tuple[int, ...]],
    column: Callable[[str, int, bool], np.ndarray],
    units: Mapping[str, str],
) -> Table:
    """The table of named arrays: (rows,) is a column, (rows, m) or (m, rows) are m columns of one name.

    Rows are the longer axis. Arrays of other shapes, of one row and of more than ``WIDEST`` columns are left out.
    ``column``: the values of an array at a place of its shorter axis, which is the first if it is turned.
    """
    places: list[tuple[str, int, bool]] = []
    for name, shape in shapes.items():
        if len(shape) not in (1, 2) or max(shape) < 2 or (len(shape) == 2 and min(shape) > WIDEST):
            continue
        turned = len(shape) == 2 and shape[0] < shape[1]
        places += [(name, place, turned) for place in range(min(shape) if len(shape) == 2 else 1)]
    if not places:
        raise InvalidValueError(f"{path} holds no column of numbers: arrays of at least two rows were expected")

    def read(asked: Sequence[int]) -> list[FloatArray]:
        return [np.array(column(*places[place]), dtype=np.float64) for place in asked]

    names = tuple(name for name, _, _ in places)
    return Table(path, names, tuple(units.get(name, "") for name in names), read, ordered=len(shapes) == 1)


def extra(module: str, name: str, path: Path) -> ModuleType:
    """The library ``module`` that reads ``path``. Raises ``InvalidValueError`` with the extra ``name`` to install."""
    try:
        return import_module(module)
    except ImportError as error:
        raise InvalidValueError(
            f'{path.name} needs a library that is not installed: pip install "koopcli[{name}]"'
        ) from error
