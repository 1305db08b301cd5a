"""The values of a map: each is checked for its kind, and the error names its place."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from typing import Any

from koopcli.errors import InvalidValueError
from koopcli.logs.entries import Column


def near(name: str, names: Sequence[str]) -> str:
    """What to write instead of ``name``: those of a like name, or all."""
    matches = get_close_matches(name, names, 3, 0.5)
    if matches:
        return f"did you mean {' or '.join(repr(match) for match in matches)}?"
    shown = ", ".join(names[:12]) + (f" and {len(names) - 12} more" if len(names) > 12 else "")
    return f"write one of {shown}" if names else "there is none to choose from"


def checked(values: Mapping[str, Any], keys: Sequence[str], where: str) -> None:
    """Raise ``InvalidValueError`` for a key of the table at ``where`` that is none of ``keys``."""
    for key in values:
        if key not in keys:
            raise InvalidValueError(f"{where} has no key '{key}': {near(key, keys)}")


def table(value: Any, where: str) -> Mapping[str, Any]:
    """A table of the map."""
    if not isinstance(value, Mapping):
        raise InvalidValueError(f"{where} is {value!r}: a table such as {{ ... }} was expected")
    return value


def number(value: Any, where: str, *, above: float | None = None, low: float | None = None) -> float:
    """A number in its bounds."""
    fits = isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
    if not fits or (above is not None and value <= above) or (low is not None and value < low):
        bound = f" above {above:g}" if above is not None else f" of at least {low:g}" if low is not None else ""
        raise InvalidValueError(f"{where} is {value!r}: a number{bound} was expected")
    return float(value)


def whole(value: Any, where: str, low: int) -> int:
    """A whole number of at least ``low``."""
    if not isinstance(value, int) or isinstance(value, bool) or value < low:
        raise InvalidValueError(f"{where} is {value!r}: a whole number of at least {low} was expected")
    return value


def text(value: Any, where: str) -> str:
    """A text."""
    if not isinstance(value, str):
        raise InvalidValueError(f"{where} is {value!r}: a text was expected")
    return value


def choice(value: Any, names: Sequence[str], where: str) -> str:
    """One of the texts ``names``."""
    if value not in names:
        raise InvalidValueError(f"{where} is {value!r}: {' or '.join(repr(name) for name in names)} was expected")
    return str(value)


def listed(value: Any, where: str) -> list[Any]:
    """A list that has entries; a single text counts as a list of one."""
    entries = [value] if isinstance(value, str) else value
    if not isinstance(entries, (list, tuple)):
        raise InvalidValueError(f"{where} is {value!r}: a list was expected")
    return list(entries)


def column(value: Any, where: str) -> Column:
    """A column by its name, or by its number counted from 0."""
    if (
        isinstance(value, bool)
        or not isinstance(value, (int, str))
        or value == ""
        or (isinstance(value, int) and value < 0)
    ):
        raise InvalidValueError(f"{where} is {value!r}: a column's name, or its number counted from 0, was expected")
    return value
