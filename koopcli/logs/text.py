"""What a text file looks like: its delimiter, decimals, comments, header and units, seen in its first lines."""

from __future__ import annotations

import codecs
import re
from collections import Counter
from pathlib import Path

from koopcli.errors import InvalidValueError
from koopcli.logs.rows import TextLayout, number, read_columns, read_text, split, unquoted
from koopcli.logs.units import known

__all__ = ["TextLayout", "read_columns", "read_text", "sniff", "split_unit"]

LOOKED_AT = 60  # lines
BYTES = 1 << 18
DELIMITERS = (",", ";", "\t", "|", None)
COMMENTS = ("#", "%", "//")
DECIMAL_COMMA = re.compile(r"^\s*\"?[-+]?\d+,\d+([eE][-+]?\d+)?\"?\s*$")
BEFORE_UNIT = re.compile(r"\s+([(\[<{])")
BRACKETS = re.compile(r"^(.*?)\s*(?:\(([^()]*)\)|\[([^\[\]]*)\]|<([^<>]*)>|\{([^{}]*)\})\s*$")


def sniff(
    path: Path,
    *,
    delimiter: str | None = None,
    decimal: str | None = None,
    comment: str | None = None,
    header: int | None = None,
    units_row: int | None = None,
    quoted_rows: bool | None = None,
) -> TextLayout:
    """The layout of a text file, judged by some sixty lines; what is given is taken as it is.

    ``delimiter``: " " for white space; ``header``, ``units_row``: lines counted from 1, 0 for none.
    Raises ``InvalidValueError`` for a file that is empty or holds no row of numbers.
    """
    lines, encoding = _first_lines(path)
    if not any(line.strip() for line in lines):
        raise InvalidValueError(f"{path} is empty: a log with rows of numbers was expected")
    quoted = _quoted(lines) if quoted_rows is None else quoted_rows
    bare = [unquoted(line) if quoted else line for line in lines]
    mark, point = _separators(bare, delimiter, decimal)
    first = _first_row(bare, mark, point, max(header or 0, units_row or 0))
    if first is None:
        raise InvalidValueError(f"{path} holds no row of numbers: a log with numbers in columns was expected")
    columns = Counter(len(split(line, mark)) for line in bare[first:] if line.strip()).most_common(1)[0][0]
    sign = comment if comment is not None else _comment(bare[:first])
    above = {line + 1: _fields(bare[line], mark, sign) for line in range(first)}
    for line, fields in above.items():
        if len(fields) == columns - 1 > 1:  # an index without a name
            above[line] = ["", *fields]
    titles = [line for line, fields in above.items() if len(fields) == columns and not _is_numbers(fields, point)]
    if header is None or units_row is None:
        seen = _title_lines(titles, above, mark)
        header, units_row = seen[0] if header is None else header, seen[1] if units_row is None else units_row
    names, units = _columns(above.get(header, []), above.get(units_row, []), columns)
    return TextLayout(mark, point, sign, header or None, units_row or None, names, units, quoted, first, encoding)


def split_unit(title: str) -> tuple[str, str]:
    """Name and unit of a column's ``title``: `vx(m/s)`, `vx [m/s]` and `# vx` are `vx`; no unit is ""."""
    bare = title.strip().strip('"').strip()
    match = BRACKETS.match(bare)
    if match is None or not match.group(1):
        return bare, ""
    unit = next(group for group in match.groups()[1:] if group is not None).strip()
    if unit.isdigit():  # an index, as in q(1)
        return bare, ""
    return match.group(1).strip(), unit


def _first_lines(path: Path) -> tuple[list[str], str]:
    with path.open("rb") as stream:
        content = stream.read(BYTES)
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        encoding = "utf-16"
    else:
        encoding = "utf-8-sig" if content.startswith(codecs.BOM_UTF8) else "utf-8"
    whole = len(content) < BYTES
    try:
        text = content.decode(encoding) if whole else codecs.getincrementaldecoder(encoding)().decode(content)
    except UnicodeDecodeError:
        encoding = "latin-1"
        text = content.decode(encoding)
    if "\0" in text:
        raise InvalidValueError(f"{path} is no text: a text file, .npy, .npz, .h5 or .mat was expected")
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    return (lines if whole or len(lines) < 2 else lines[:-1])[:LOOKED_AT], encoding


def _quoted(lines: list[str]) -> bool:
    """Whether every row is one quoted field, whatever the header is."""
    rows = [line.strip() for line in lines[1:] if line.strip()]
    single = [len(row) > 2 and row[0] == row[-1] == '"' and len(split(row, ",")) == 1 for row in rows]
    inside = [any(len(split(unquoted(row), mark)) > 1 for mark in DELIMITERS) for row in rows]
    return bool(rows) and all(single) and all(inside)


def _separators(lines: list[str], delimiter: str | None, decimal: str | None) -> tuple[str | None, str]:
    """The delimiter and the decimal mark under which the most fields are numbers, in rows of one length."""
    marks: tuple[str | None, ...] = DELIMITERS
    if delimiter is not None:
        marks = (None if delimiter.isspace() and delimiter != "\t" else delimiter,)
    scores: list[tuple[float, int, str | None, str]] = []
    for place, mark in enumerate(marks):
        points = (".", ",") if decimal is None else (decimal,)
        scores.extend((_score(lines, mark, point), -place, mark, point) for point in points)
    _, _, mark, point = max(scores, key=lambda score: score[:2])
    return mark, point


def _score(lines: list[str], mark: str | None, point: str) -> float:
    rows = [split(line, mark) for line in lines[len(lines) // 3 :] if line.strip()]
    if not rows:
        return 0.0
    length, times = Counter(map(len, rows)).most_common(1)[0]
    numbers = sum(_is_number(field, point) for fields in rows if len(fields) == length for field in fields)
    commas = sum(bool(DECIMAL_COMMA.match(field)) for fields in rows for field in fields)
    if point == "," and not commas:
        return 0.0
    return numbers * times / len(rows) / len(rows) / (2 if length == 1 else 1)


def _is_number(text: str, point: str) -> bool:
    if not text:
        return False
    try:
        number(text, point)
    except ValueError:
        return False
    return point == "." or "." not in text


def _is_numbers(fields: list[str], point: str) -> bool:
    return any(_is_number(field, point) for field in fields)


def _first_row(lines: list[str], mark: str | None, point: str, after: int) -> int | None:
    """The place of the first line that has numbers where the later lines have them."""
    rows = [split(line, mark) for line in lines]
    tail = [fields for fields in rows[len(rows) // 3 :] if _is_numbers(fields, point)] or rows
    length = Counter(map(len, tail)).most_common(1)[0][0]
    tail = [fields for fields in tail if len(fields) == length]
    usual = [c for c in range(length) if sum(_is_number(f[c], point) for f in tail) > len(tail) / 2]
    for place, fields in enumerate(rows):
        numbers = sum(c < len(fields) and _is_number(fields[c], point) for c in usual)
        if place >= after and usual and numbers > len(usual) / 2:
            return place
    return None


def _comment(above: list[str]) -> str:
    marks = [mark for line in above for mark in COMMENTS if line.strip().startswith(mark)]
    return marks[0] if marks else "#"


def _fields(line: str, mark: str | None, comment: str) -> list[str]:
    bare = line.strip("\r\n")
    if comment and bare.lstrip().startswith(comment):
        bare = bare.lstrip().lstrip(comment)
    if mark is None:
        bare = BEFORE_UNIT.sub(r"\1", bare)
    return split(bare, mark)


def _title_lines(titles: list[int], above: dict[int, list[str]], mark: str | None) -> tuple[int, int]:
    """The lines of the names and of the units; 0 for none."""
    if len(titles) < 2:
        return (titles[0] if titles else 0), 0
    last = above[titles[-1]]
    filled = [field for field in last if field]
    units = sum(known(field.strip("()[]<>{} ")) or field in ("-", "1", "[-]", "(-)", "[]") for field in filled)
    if units * 2 <= len(filled):
        return titles[-1], 0
    return (titles[-2] if mark is None else titles[0]), titles[-1]


def _columns(header: list[str], units_row: list[str], columns: int) -> tuple[tuple[str, ...], tuple[str, ...]]:
    pairs = [split_unit(title) for title in header][:columns]
    pairs += [("", "")] * (columns - len(pairs))
    below = [field.strip("()[]<>{} ") for field in units_row][:columns]
    below += [""] * (columns - len(below))
    units = tuple(unit or row for (_, unit), row in zip(pairs, below, strict=True))
    return tuple(name for name, _ in pairs), units
