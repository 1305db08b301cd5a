"""The rows of a text file: numbers by :func:`numpy.loadtxt` where it can, line by line where it cannot."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any, TextIO

import numpy as np
import numpy.typing as npt

from koopcli.errors import InvalidValueError
from koopcli.progress import Progress, silent
from koopcli.records import FloatArray

DATE = re.compile(r"\d[-_:/.T]\d+[-_:/.T]\d")
CHUNK = 20_000  # lines read at a time
MISSING = frozenset(
    {"", "na", "n/a", "nan", "-nan", "+nan", "null", "none", "nil", "-", "--", "?", "nan(ind)", "-nan(ind)"}
)


@dataclass(frozen=True)
class TextLayout:
    """How a text file is laid out.

    ``delimiter``: None for white space. ``header`` and ``units_row``: their lines, counted from 1, None for none.
    ``names`` and ``units``, one for each column, without marks and brackets; "" for what has none. ``quoted_rows``:
    each row is one quoted field. ``skip``: the lines before the first row of numbers. ``encoding``: of the file.
    """

    delimiter: str | None
    decimal: str
    comment: str
    header: int | None
    units_row: int | None
    names: tuple[str, ...]
    units: tuple[str, ...]
    quoted_rows: bool
    skip: int
    encoding: str = "utf-8"


def split(line: str, delimiter: str | None) -> list[str]:
    """The fields of a line, without white space and quotes around them."""
    if delimiter is None:
        return [field.strip('"') for field in line.split()]
    if '"' not in line:
        return [field.strip() for field in line.split(delimiter)]
    fields = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
    return [field.strip().strip('"').strip() for field in fields]


def unquoted(line: str) -> str:
    """The content of a ``line`` that is one quoted field; any other line as it is."""
    bare = line.strip()
    if len(bare) > 1 and bare[0] == bare[-1] == '"':
        return bare[1:-1].replace('""', '"')
    return bare


def number(text: str, decimal: str = ".") -> float:
    """The number in ``text``, nan for one that is missing. Raises ``ValueError`` for any other text."""
    bare = text.strip().strip('"').strip()
    if bare.casefold() in MISSING:
        return math.nan
    if "_" in bare:  # which Python takes for digits apart, as in a date
        raise ValueError(bare)
    return float(bare.replace(decimal, ".") if decimal != "." else bare)


def open_text(path: Path, layout: TextLayout) -> TextIO:
    """The file, opened at its first row."""
    stream = path.open(encoding=layout.encoding, errors="replace")
    for _ in islice(stream, layout.skip):
        pass
    return stream


def data_lines(stream: Iterable[str], layout: TextLayout) -> Iterator[tuple[int, str]]:
    """The lines that hold rows with their numbers in the file, from 1; comments and empty lines are left out."""
    for line, text in enumerate(stream, layout.skip + 1):
        bare = unquoted(text) if layout.quoted_rows else text.strip()
        if bare and not (layout.comment and bare.startswith(layout.comment)):
            yield line, text.rstrip("\r\n")


def read_columns(
    path: Path, layout: TextLayout, columns: Sequence[int], progress: Progress = silent
) -> list[FloatArray]:
    """The ``columns`` of a text file as numbers, each (rows,); nan where a field is empty or says that it is missing.

    A last line that was cut off is left out. Raises ``InvalidValueError``, with file, line and column, for text in a
    number and for a line that is too short.
    """
    size = max(1, path.stat().st_size)
    parts: list[list[FloatArray]] = [[] for _ in columns]
    line, read = layout.skip, 0
    with open_text(path, layout) as stream:
        while lines := list(islice(stream, CHUNK)):
            read += sum(map(len, lines))
            if len(lines) < CHUNK:
                _drop_cut_line(lines, layout)
            chunk = _chunk(path, layout, columns, lines, line)
            for column, part in enumerate(parts):
                part.append(chunk[:, column].copy())
            line += len(lines)
            progress(min(read, size), size)
    joined: list[FloatArray] = []
    for part in parts:
        joined.append(np.concatenate(part) if part else np.empty(0))
        part.clear()  # so that memory holds each number once
    return joined


def read_words(path: Path, layout: TextLayout, column: int) -> list[str]:
    """One column of a text file as text, as in a time that is written as a date."""
    words = []
    with open_text(path, layout) as stream:
        for line, text in data_lines(stream, layout):
            fields = split(unquoted(text) if layout.quoted_rows else text, layout.delimiter)
            if column >= len(fields):
                raise _too_short(path, line, len(fields), column)
            words.append(fields[column])
    return words


def read_text(path: Path, layout: TextLayout) -> tuple[tuple[str, ...], npt.NDArray[Any]]:
    """Names and values (rows, columns) of a whole text file: of objects where a column holds text, else of floats.

    Raises ``InvalidValueError`` where lines are too short.
    """
    columns: list[npt.NDArray[Any]] = []
    for column in range(len(layout.names)):
        try:
            columns.append(read_columns(path, layout, [column])[0])
        except InvalidValueError:
            columns.append(np.array(read_words(path, layout, column), dtype=object))
    return layout.names, np.stack(columns, axis=1) if columns else np.empty((0, 0))


def line_of(path: Path, layout: TextLayout, row: int) -> int:
    """The line, from 1, that holds a row, from 0."""
    with open_text(path, layout) as stream:
        line, _ = next(islice(data_lines(stream, layout), row, None), (layout.skip + row + 1, ""))
    return line


def _drop_cut_line(lines: list[str], layout: TextLayout) -> None:
    if lines and not lines[-1].endswith("\n"):
        fields = split(unquoted(lines[-1]) if layout.quoted_rows else lines[-1], layout.delimiter)
        if len(fields) < len(layout.names) and len(lines) > 1:
            lines.pop()


def _chunk(path: Path, layout: TextLayout, columns: Sequence[int], lines: list[str], before: int) -> FloatArray:
    """The values (rows, columns) of some lines; ``before``: the number of lines before them."""
    plain = not layout.quoted_rows and layout.decimal == "."
    for prepare in (list, lambda lines: _mended(lines, layout))[0 if plain else 1 :]:
        try:
            return _loaded(prepare(lines), layout, columns)
        except ValueError:
            continue
    shifted = TextLayout(**{**vars(layout), "skip": before})
    rows = [_row(path, layout, columns, line, text) for line, text in data_lines(lines, shifted)]
    return np.array(rows, dtype=float).reshape(-1, len(columns))


def _loaded(lines: list[str], layout: TextLayout, columns: Sequence[int]) -> FloatArray:
    if next(data_lines(lines, layout), None) is None:
        return np.empty((0, len(columns)))
    return np.loadtxt(
        lines,
        delimiter=layout.delimiter,
        comments=layout.comment or None,
        usecols=columns,
        ndmin=2,
        quotechar='"' if '"' in lines[0] else None,
    )


def _mended(lines: list[str], layout: TextLayout) -> list[str]:
    """Lines with decimal points, without quotes around rows, and with nan in their empty fields."""
    texts = [unquoted(line) if layout.quoted_rows else line.rstrip("\r\n") for line in lines]
    mark = layout.delimiter
    if layout.decimal not in (".", mark):
        texts = [text.replace(layout.decimal, ".") for text in texts]
    if mark is None or mark == " ":
        return texts
    empty, filled = mark * 2, f"{mark}nan{mark}"
    texts = [text.replace(empty, filled).replace(empty, filled) if empty in text else text for text in texts]
    return [_ends_filled(text, mark) if text[:1] == mark or text[-1:] == mark else text for text in texts]


def _ends_filled(text: str, mark: str) -> str:
    return f"{'nan' if text.startswith(mark) else ''}{text}{'nan' if text.endswith(mark) else ''}"


def _row(path: Path, layout: TextLayout, columns: Sequence[int], line: int, text: str) -> list[float]:
    fields = split(unquoted(text) if layout.quoted_rows else text, layout.delimiter)
    values = []
    for column in columns:
        if column >= len(fields):
            raise _too_short(path, line, len(fields), column)
        try:
            values.append(number(fields[column], layout.decimal))
        except ValueError:
            name = layout.names[column] if column < len(layout.names) and layout.names[column] else str(column)
            text = fields[column][:40]
            mending = "say its format in the map, if it is a time" if DATE.search(text) else "mend that line"
            raise InvalidValueError(
                f"{path}, line {line}, column '{name}': '{text}' is not a number: {mending}, or map another column"
            ) from None
    return values


def _too_short(path: Path, line: int, fields: int, column: int) -> InvalidValueError:
    return InvalidValueError(
        f"{path}, line {line} has {fields} fields, column {column}, counted from 0, was expected: mend that line, or "
        "say the delimiter in the map"
    )
