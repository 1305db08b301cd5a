"""Grids of settings: ``--set stage.key=VALUES`` with several values, and their combinations."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

from koopcli.config.changes import parse_set, toml_value
from koopcli.errors import InvalidValueError, UsageError

MOST = 10_000  # cells
NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
RANGE = re.compile(rf"\s*({NUMBER})\s*:\s*({NUMBER})\s*(?::\s*({NUMBER})\s*)?")
CLOSES = {"[": "]", "{": "}", '"': '"', "'": "'"}


@dataclass(frozen=True)
class GridAxis:
    """One swept setting: its full ``name`` and its raw ``values``, each with the ``texts`` that people write."""

    name: str
    values: tuple[Any, ...]

    @property
    def texts(self) -> tuple[str, ...]:
        """The values in words."""
        return tuple(text_of(value) for value in self.values)


@dataclass(frozen=True)
class Grid:
    """The ``axes`` with several values, the last one running fastest, and what is the same everywhere."""

    axes: tuple[GridAxis, ...]
    fixed: tuple[tuple[str, Any], ...]

    def __len__(self) -> int:
        return math.prod(len(axis.values) for axis in self.axes)

    def cells(self) -> Iterator[tuple[tuple[int, ...], list[tuple[str, Any]]]]:
        """Every combination: its place on each axis, and all settings by their full names."""
        for place in product(*(range(len(axis.values)) for axis in self.axes)):
            chosen = [(axis.name, axis.values[i]) for axis, i in zip(self.axes, place, strict=True)]
            yield place, [*self.fixed, *chosen]


def parse_grid(assignments: Sequence[str]) -> Grid:
    """The grid of ``stage.key=VALUES``, where VALUES are values and ranges with commas between them.

    A range is START:STOP or START:STOP:STEP, both ends included. Raises ``UsageError`` for what is no setting and for
    one that is given twice, ``InvalidValueError`` for a range without end and for more than ``MOST`` cells.
    """
    axes, fixed = [], []
    names: set[str] = set()
    for text in assignments:
        parse_set([text])  # names and form are those of any command
        name, _, raw = (part.strip() for part in text.partition("="))
        if name in names:
            raise UsageError(f"--set {name} is given twice: write all its values into one, such as {name}=1,2,5:8")
        names.add(name)
        values = [value for word in split(raw) for value in _values(name, word)]
        texts: set[str] = set()
        for value in values:
            if text_of(value) in texts:
                raise InvalidValueError(f"--set {text}: the value {text_of(value)} stands there twice")
            texts.add(text_of(value))
        if len(values) > 1:
            axes.append(GridAxis(name, tuple(values)))
        else:
            fixed.append((name, values[0]))
    grid = Grid(tuple(axes), tuple(fixed))
    if len(grid) > MOST:
        raise InvalidValueError(f"a grid of {len(grid):,} cells is more than {MOST:,}: sweep fewer values at a time")
    return grid


def split(text: str) -> list[str]:
    """``text`` at its commas, but for those inside brackets and quotes."""
    words: list[str] = [""]
    inside: list[str] = []  # what closes the brackets and quotes that are open
    for letter in text:
        if inside and letter == inside[-1]:
            inside.pop()
        elif letter in CLOSES and not (inside and inside[-1] in "\"'"):
            inside.append(CLOSES[letter])
        if letter == "," and not inside:
            words.append("")
        else:
            words[-1] += letter
    return words


def text_of(value: object) -> str:
    """A value as it is written on the command line."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        short = f"{value:.12g}"
        return short if float(short) == value else repr(value)
    if isinstance(value, list):
        return f"[{', '.join(map(text_of, value))}]"
    return str(value)


def _values(name: str, word: str) -> list[Any]:
    """The values that one of the words between commas stands for."""
    if not word.strip():
        raise UsageError(f"--set {name}: there is a value missing; write such as {name}=1,2,5:8")
    match = RANGE.fullmatch(word)
    if match is None:
        return [toml_value(word)]
    whole = all(part is None or re.fullmatch(r"[+-]?\d+", part) for part in match.groups())
    number: Callable[[str], Any] = int if whole else float
    start, stop, step = (number(part) if part else 1 for part in match.groups())
    count = (stop - start) / step if step else math.inf
    if not 0 <= count < MOST:
        raise InvalidValueError(
            f"--set {name}={word.strip()}: no range; write START:STOP or START:STOP:STEP with both ends included, "
            f"such as {name}=1:12, of at most {MOST:,} values"
        )
    values = [start + i * step for i in range(math.floor(count + 1e-9) + 1)]
    return values if whole else [float(f"{value:.12g}") for value in values]
