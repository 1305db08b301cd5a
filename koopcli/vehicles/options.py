"""What the plants can be told beside their vehicle, and what each of them takes unless told otherwise."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any


@dataclass(frozen=True)
class Options:
    """Options of all plants; each has a use for some of them.

    ``force_per``: what an input force acts on, ``axle`` or ``wheel``. ``v_eps`` in m/s: a wheel slower than this
    counts as that fast in its slips. ``combined``: how the forces along and across a wheel share its grip, ``none`` or
    ``ellipse``. ``brake_width`` in rad/s: wheel rate over which the direction of a brake torque turns.
    """

    force_per: str = "axle"
    v_eps: float | None = None
    combined: str | None = None
    brake_width: float | None = None


OPTIONS = tuple(option.name for option in fields(Options))
CUSTOMARY: dict[str, dict[str, Any]] = {
    "forces": {},
    "slips": {"v_eps": 0.1, "combined": "none"},
    "wheels": {"v_eps": 0.5, "combined": "ellipse", "brake_width": 1.0},
}
