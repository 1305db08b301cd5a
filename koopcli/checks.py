"""Declared settings: typed, bounded dataclass fields, and the one place that turns raw values into them."""

from __future__ import annotations

import math
import sys
import types
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, field, fields, is_dataclass
from difflib import get_close_matches
from functools import cache
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from koopcli.errors import InvalidValueError, KoopError, UsageError

T = TypeVar("T")


@dataclass(frozen=True)
class Origin:
    """Where a raw value came from: what an error message names, and what a wrong name costs."""

    label: str = ""
    misnamed: type[KoopError] = UsageError

    def say(self, text: str) -> str:
        """``text`` with the origin in front."""
        return f"{self.label}: {text}" if self.label else text


COMMAND_LINE = Origin()


def from_file(path: object) -> Origin:
    """The origin of values read from a user's file."""
    return Origin(str(path), InvalidValueError)


def setting(
    default: Any = MISSING,
    *,
    help: str = "",
    low: float | None = None,
    above: float | None = None,
    high: float | None = None,
    unit: str = "",
    unique: bool = False,
    empty: bool = False,
) -> Any:
    """A dataclass field with its documentation and bounds: ``low <= value``, ``above < value``, ``value <= high``.

    ``unique``: a list without repetition; ``empty``: a list that may have no entry.
    """
    meta = {"help": help, "low": low, "above": above, "high": high, "unit": unit, "unique": unique, "empty": empty}
    return field(metadata=meta) if default is MISSING else field(default=default, metadata=meta)


def build(cls: type[T], values: Mapping[str, object], origin: Origin = COMMAND_LINE, prefix: str = "") -> T:
    """An instance of the settings class ``cls`` from raw ``values``, each coerced to its declared type.

    Raises ``origin.misnamed`` for a key or an enumerated value that does not exist and ``InvalidValueError``
    for a missing key, a wrong type, a value out of bounds, nan or inf.
    """
    declared = {f.name: f for f in fields(cls)}  # type: ignore[arg-type]
    for key in values:
        if key not in declared:
            raise origin.misnamed(origin.say(f"unknown setting '{prefix}{key}'{candidates(key, declared)}"))
    hints = _hints(cls)  # type: ignore[arg-type]  # classes are hashable
    done: dict[str, object] = {}
    for name, spec in declared.items():
        if name in values:
            done[name] = coerce(hints[name], values[name], f"{prefix}{name}", spec.metadata, origin)
        elif spec.default is MISSING and spec.default_factory is MISSING:
            raise InvalidValueError(origin.say(f"missing key '{prefix}{name}'"))
    return cls(**done)


@cache
def _hints(cls: type) -> dict[str, Any]:
    """The types of the fields of ``cls``, worked out once: an experiment is built of thousands of settings."""
    return get_type_hints(cls)


def coerce(  # noqa: PLR0911  (one return for each kind of type reads best)
    kind: Any, value: object, name: str, bounds: Mapping[str, Any], origin: Origin
) -> object:
    """``value`` as the declared type ``kind``, so that 1 and 1.0 are one setting; bounds checked."""
    if isinstance(kind, type) and is_dataclass(kind):
        if isinstance(value, Mapping):
            return build(kind, value, origin, f"{name}.")
        if type(value) is kind:
            return value
        raise InvalidValueError(origin.say(f"'{name}' must be a table of settings, got {_short(repr(value))}"))
    if get_origin(kind) is Literal:
        return _choice(get_args(kind), value, name, origin)
    if get_origin(kind) in (Union, types.UnionType):
        if value is None:
            return None
        (inner,) = [k for k in get_args(kind) if k is not type(None)]
        return coerce(inner, value, name, bounds, origin)
    if get_origin(kind) is tuple:
        inner = get_args(kind)[0]
        if isinstance(value, str) and get_origin(inner) is Literal:
            value = (value,)  # one name, as an option gives it
        listed = isinstance(value, (list, tuple)) and (len(value) > 0 or bounds.get("empty"))
        if not listed or not isinstance(value, (list, tuple)):
            raise InvalidValueError(
                origin.say(f"'{name}' must be a non-empty list such as [1, 2], got {_short(repr(value))}")
            )
        values = tuple(coerce(inner, v, f"{name}[{i}]", bounds, origin) for i, v in enumerate(value))
        if bounds.get("unique") and len(set(values)) < len(values):
            raise InvalidValueError(origin.say(f"'{name}' names a value twice: {_short(repr(value))}"))
        return values
    number = _number(kind, value, name, origin)
    _within(number, name, bounds, origin)
    return number


def candidates(name: str, known: Any) -> str:
    """The tail of an error message that lists what would have been right, the nearest first."""
    names = [str(k) for k in known]
    near = get_close_matches(name, names, n=1, cutoff=0.5)
    listed = ", ".join(names) if names else "none"
    return f": did you mean '{near[0]}'? (known: {listed})" if near else f" (known: {listed})"


def _choice(allowed: tuple[Any, ...], value: object, name: str, origin: Origin) -> object:
    if not isinstance(value, str) or value not in allowed:
        raise origin.misnamed(
            origin.say(f"'{name}' cannot be {_short(repr(value))}; choose one of {', '.join(map(str, allowed))}")
        )
    return value


def _number(kind: Any, value: object, name: str, origin: Origin) -> Any:
    wanted = {int: "a whole number", float: "a number", str: "a text", bool: "true or false"}[kind]
    wrong = InvalidValueError(origin.say(f"'{name}' must be {wanted}, got {_short(repr(value))}"))
    if isinstance(value, bool) != (kind is bool):
        raise wrong
    if kind is int and isinstance(value, float) and value.is_integer():
        return int(value)
    if kind is float and isinstance(value, int):
        return float(value) if abs(value) < sys.float_info.max else math.inf
    if not isinstance(value, kind):
        raise wrong
    return value


def _short(text: str) -> str:
    return text if len(text) <= 60 else f"{text[:57]}..."


def _within(value: Any, name: str, bounds: Mapping[str, Any], origin: Origin) -> None:
    if isinstance(value, str):
        return
    unit = f" {bounds['unit']}" if bounds.get("unit") not in (None, "", "1") else ""
    shown = f"{value:.6g}" if isinstance(value, float) else _short(str(value))
    if isinstance(value, float) and not math.isfinite(value):
        raise InvalidValueError(origin.say(f"'{name}' must be a finite number, got {shown}"))
    low, above, high = bounds.get("low"), bounds.get("above"), bounds.get("high")
    if low is not None and value < low:
        raise InvalidValueError(origin.say(f"'{name}' must be at least {low:g}{unit}, got {shown}"))
    if above is not None and value <= above:
        raise InvalidValueError(origin.say(f"'{name}' must be above {above:g}{unit}, got {shown}"))
    if high is not None and value > high:
        raise InvalidValueError(origin.say(f"'{name}' must be at most {high:g}{unit}, got {shown}"))
