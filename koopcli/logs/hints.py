"""What would mend a log whose signals do not fit together, given what the map says of them already."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from koopcli.logs.units import G

DEGREES, KMH = 57.3, 3.6  # of one in SI, as hints name them
USUAL_WHEELBASE = 2.7  # m, where none is known
RATIOS = (7.0, 26.0)  # of steerings
POSSIBLE = 60.0  # m/s², of lateral acceleration
NEAR = 1.8  # how far from a factor it is still worth a thought

Told = tuple[str, str]  # a signal and its unit


@dataclass(frozen=True)
class Said:
    """What the map says: the ``units`` of signals by name, and the ``ratio`` of the steering."""

    units: Mapping[str, str] = field(default_factory=dict)
    ratio: float = 1.0

    def lacks(self, told: Told) -> bool:
        """Whether a unit may be proposed for a signal: the map does not say it already."""
        return self.units.get(told[0]) != told[1]

    def may_have(self, told: Told) -> bool:
        """Whether a unit may be there by mistake: the map says it, or nothing is known of the map."""
        return self.units.get(told[0], told[1]) == told[1]


@dataclass(frozen=True)
class Cause:
    """What makes a value from ``low`` to ``high`` times as large as it is.

    ``lacking``: units that the map must not have for it to be so; ``present``: one that it must have; ``rare``: times
    as far as it is it counts, where simpler causes may be so too.
    """

    low: float
    high: float
    words: str
    lacking: tuple[Told, ...] = ()
    present: tuple[Told, ...] = ()
    rare: float = 1.0

    def possible(self, said: Said) -> bool:
        """Whether the map leaves it open."""
        return all(map(said.lacks, self.lacking)) and all(map(said.may_have, self.present))


SPEED, RATE, STEER, ACCELERATION = ("v_x", "km/h"), ("yaw_rate", "deg/s"), ("steer", "deg"), ("a_y", "g")
FAST = "v_x is 3.6 times too large (unit = 'km/h'?)"
SLOW = "v_x is 3.6 times too small (not in km/h?)"
TURNS = "yaw_rate is 57.3 times too large (unit = 'deg/s'?)"
CREEPS = "yaw_rate is 57.3 times too small (not in deg/s?)"


def _wheelbase_causes(said: Said) -> tuple[Cause, ...]:
    """What changes the wheelbase from the log; a ratio that the map says counts too."""
    wheel = RATIOS[0] / said.ratio, RATIOS[1] / said.ratio
    return (
        Cause(1 / DEGREES, 1 / DEGREES, TURNS, (RATE,)),
        Cause(1 / DEGREES, 1 / DEGREES, "steer is 57.3 times too small (not in deg?)", (), (STEER,)),
        Cause(1 / KMH, 1 / KMH, "a road without curves pulls it down"),
        Cause(1 / KMH, 1 / KMH, SLOW, (), (SPEED,)),
        Cause(KMH, KMH, FAST, (SPEED,)),
        Cause(wheel[0], wheel[1], "steer is the angle of the steering wheel (ratio = {ratio:.3g}?)", rare=1.5),
        Cause(
            KMH * wheel[0],
            KMH * wheel[1],
            f"{FAST} and steer is the angle of the steering wheel (ratio = {{fast:.3g}}?)",
            (SPEED,),
            rare=1.4,
        ),
        Cause(DEGREES, DEGREES, "steer is 57.3 times too large (unit = 'deg'?)", (STEER,)),
        Cause(DEGREES, DEGREES, CREEPS, (), (RATE,)),
        Cause(
            DEGREES * wheel[0],
            DEGREES * wheel[1],
            "steer is the angle of the steering wheel in degrees (unit = 'deg', ratio = {degrees:.3g}?)",
            (STEER,),
        ),
    )


SLOPES = (  # of v_x · yaw_rate over a_y
    Cause(KMH, KMH, FAST, (SPEED,)),
    Cause(1 / KMH, 1 / KMH, SLOW, (), (SPEED,)),
    Cause(DEGREES, DEGREES, TURNS, (RATE,)),
    Cause(1 / DEGREES, 1 / DEGREES, CREEPS, (), (RATE,)),
    Cause(G, G, "a_y is 9.81 times too small (unit = 'g'?)", (ACCELERATION,)),
    Cause(1 / G, 1 / G, "a_y is 9.81 times too large (not in g?)", (), (ACCELERATION,)),
    Cause(KMH * DEGREES, KMH * DEGREES, f"{FAST} and {TURNS}", (SPEED, RATE)),
)


def factor_hint(ratio: float, said: Said | None = None, lateral: float = 0.0) -> str:
    """What would mend a wheelbase that comes out ``ratio`` times as long as it is.

    ``said``: by the map already; ``lateral``: v_x · yaw_rate in m/s², which no hint makes larger than a car can.
    """
    if ratio <= 0:
        return "steer or yaw_rate has the wrong sign: sign = -1 for one of them"
    known = Said() if said is None else said
    words = _near(ratio, _wheelbase_causes(known), known)
    words = [cause for cause in words if cause != CREEPS or lateral * DEGREES < POSSIBLE]
    words = words or ["the units of steer, yaw_rate and v_x do not fit together ({times:.3g} times)"]
    wheel = ratio * known.ratio
    return ", or ".join(words).format(ratio=wheel, fast=wheel / KMH, degrees=wheel / DEGREES, times=ratio)


def slope_hint(slope: float, said: Said) -> str:
    """What would mend a v_x · yaw_rate that is ``slope`` times a_y."""
    words = _near(abs(slope), SLOPES, said) if not 0.7 <= abs(slope) <= 1.4 else []
    if slope < 0:
        sign = "sign = -1 for a_y or for yaw_rate: both are positive to the left"
        return f"{sign}; and {', or '.join(words)}" if words else sign
    return ", or ".join(words) or f"the units of v_x, yaw_rate and a_y do not fit together ({slope:.3g} times)"


def unit_hint(said: Said, *proposed: tuple[Told, float], otherwise: str) -> str:
    """Asks for the units, with their factors, that the map lacks; ``otherwise``: where it has them all."""
    asked = [f"{name} in {unit} (unit = '{unit}', factor {by:g})" for (name, unit), by in proposed
             if said.lacks((name, unit))]  # fmt: skip
    return f"is {', or '.join(asked)}?" if asked else otherwise


def _near(ratio: float, causes: Sequence[Cause], said: Said) -> list[str]:
    distances = [(c.rare * max(c.low / ratio, ratio / c.high, 1.0), c.words) for c in causes if c.possible(said)]
    return [words for distance, words in sorted(distances, key=lambda entry: entry[0]) if distance < NEAR]
