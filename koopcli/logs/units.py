"""The units of logs: what one of each is in SI, and how else people spell them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from difflib import get_close_matches

from koopcli.errors import InvalidValueError


@dataclass(frozen=True)
class Unit:
    """A unit by its ``name``: one of it is ``factor`` of the unit ``si``."""

    name: str
    factor: float
    si: str


G = 9.80665  # m/s², standard gravity
TURN = 2 * math.pi
UNITS = {
    unit.name: unit
    for unit in (
        Unit("m/s", 1.0, "m/s"),
        Unit("km/h", 1 / 3.6, "m/s"),
        Unit("mph", 0.44704, "m/s"),
        Unit("m", 1.0, "m"),
        Unit("s", 1.0, "s"),
        Unit("ms", 1e-3, "s"),
        Unit("us", 1e-6, "s"),
        Unit("ns", 1e-9, "s"),
        Unit("rad", 1.0, "rad"),
        Unit("deg", math.pi / 180, "rad"),
        Unit("rad/s", 1.0, "rad/s"),
        Unit("deg/s", math.pi / 180, "rad/s"),
        Unit("1/min", TURN / 60, "rad/s"),
        Unit("rpm", TURN / 60, "rad/s"),
        Unit("m/s²", 1.0, "m/s²"),
        Unit("g", G, "m/s²"),
        Unit("N", 1.0, "N"),
        Unit("kN", 1e3, "N"),
        Unit("N m", 1.0, "N m"),
        Unit("bar", 1e5, "Pa"),
        Unit("kPa", 1e3, "Pa"),
        Unit("%", 0.01, "1"),
        Unit("Pa", 1.0, "Pa"),
        Unit("1", 1.0, "1"),
    )
}
SPELLINGS = {
    "m/s": "mps m/sec ms^-1 m·s^-1 m*s^-1 metre/s meter/s",
    "km/h": "kmph kmh kph km/hr kmph^1 km·h^-1",
    "mph": "mi/h miles/h",
    "m": "metre meter metres meters",
    "s": "sec secs second seconds",
    "ms": "msec millisecond milliseconds",
    "us": "µs μs usec microsecond microseconds",
    "ns": "nsec nanosecond nanoseconds",
    "rad": "radian radians",
    "deg": "° degree degrees degs grad",
    "rad/s": "radps rad/sec radians/s rads rad·s^-1 1/s",
    "deg/s": "degps °/s deg/sec dps degree/s degrees/s °/sec",
    "1/min": "min^-1 u/min rev/min 1/minute",
    "rpm": "r/min",
    "m/s²": "m/s^2 m/s2 m/s/s m/s**2 mpss mps2 m/sec^2 m/sec2 m/s^2^ m·s^-2",
    "g": "g0 gee gn",
    "N": "newton newtons",
    "kN": "kilonewton",
    "N m": "nm n*m n·m newtonmetre n.m n-m",
    "bar": "bars",
    "kPa": "kilopascal",
    "%": "percent pct per_cent",
    "Pa": "pascal",
    "1": "- none unitless ratio fraction",
}
LOOKUP = {spelling: name for name, spellings in SPELLINGS.items() for spelling in spellings.split()}
FOLDED = {name.casefold(): name for name in UNITS} | LOOKUP


def known(text: str) -> bool:
    """Whether ``text`` is a unit that is known, in any spelling."""
    return _named(text) is not None


def unit(text: str, where: str = "") -> Unit:
    """The unit that ``text`` spells; ``where``: what the error begins with.

    Raises ``InvalidValueError`` for one that is unknown, with those of a like name.
    """
    name = _named(text)
    if name is None:
        near = get_close_matches(text.casefold(), list(FOLDED), 3, 0.5)
        names = list(dict.fromkeys(FOLDED[match] for match in near)) or list(UNITS)
        raise InvalidValueError(f"{where or 'unit'}: '{text}' is no unit that is known: write {' or '.join(names)}")
    return UNITS[name]


def _named(text: str) -> str | None:
    bare = " ".join(text.split())
    if bare in UNITS:
        return bare
    folded = bare.casefold()
    for spelling in (bare, folded, folded.replace(" ", "")):
        if spelling in FOLDED and not (folded in ("mm", "nm") and bare == "nm"):
            return FOLDED[spelling]
    return None
