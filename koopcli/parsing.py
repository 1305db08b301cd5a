"""JSON and TOML that others may have written: nested at most ``DEEPEST`` levels, whichever Python reads them."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable
from typing import Any

DEEPEST = 64  # lists and tables in one another; what goes through them here goes by recursion


class TooDeepError(ValueError):
    """Lists or tables in one another, more than ``DEEPEST``."""

    def __init__(self) -> None:
        super().__init__(f"nested over {DEEPEST} levels deep")


def parse_json(text: str | bytes) -> Any:
    """The value in the JSON ``text``. Raises ``ValueError``; of that ``TooDeepError`` for too many levels."""
    value = _parsed(json.loads, text)
    _check_depth([value])
    return value


def parse_json_at(text: str, place: int) -> Any:
    """The value in the JSON ``text`` that begins at ``place``, whatever follows it. Raises as :func:`parse_json`."""
    value, _ = _parsed(lambda whole: json.JSONDecoder().raw_decode(whole, place), text)
    _check_depth([value])
    return value


def parse_toml(text: str) -> dict[str, Any]:
    """The document in the TOML ``text``, itself no level. Raises as :func:`parse_json`."""
    document: dict[str, Any] = _parsed(tomllib.loads, text)
    _check_depth(list(document.values()))
    return document


def _parsed(parse: Callable[[Any], Any], text: str | bytes) -> Any:
    try:
        return parse(text)
    except RecursionError:  # whose limit is the interpreter's, and far above
        raise TooDeepError from None


def _check_depth(values: list[Any]) -> None:
    for _ in range(DEEPEST + 1):
        outer = [value for value in values if isinstance(value, (dict, list))]
        if not outer:
            return
        values = [inner for value in outer for inner in (value.values() if isinstance(value, dict) else value)]
    raise TooDeepError
