"""Where a car starts, for how long, and what it shall do: the scenarios by name."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from koopcli.control.controllers.controller import RECOVERY, TRACKING, TRACKING_FRONT
from koopcli.control.reference import Constant, LaneChange, Reference, YawStep, reference_of
from koopcli.errors import InvalidValueError
from koopcli.records import FloatArray
from koopcli.simulation.samples.sample import ENERGY
from koopcli.simulation.sampling import ball, semi_axes
from koopcli.vehicles.parameters import VehicleParameters

DRAWN = 200  # states of a seed, of which the first are taken: more of them change none before
SEED = 21


AHEAD = Constant((15.0, 0.0, 0.0))


@dataclass(frozen=True, eq=False)
class Scenario:
    """Initial states ``x0`` (n, 3) in m/s, m/s, rad/s; ``seconds`` of each; the ``reference``; ``tracking``: whether
    it is followed closely rather than recovered to.
    """

    name: str
    about: str
    x0: FloatArray
    seconds: float
    reference: Reference = AHEAD
    tracking: bool = False

    def weights(self, front_only: bool = False) -> tuple[float, float, float]:
        """Those of squared errors of v_x, v_y and yaw rate that suit a controller, which may steer in front only."""
        if not self.tracking:
            return RECOVERY
        return TRACKING_FRONT if front_only else TRACKING


def _from(name: str, about: str, *x0: float) -> Scenario:
    return Scenario(name, about, np.array([x0]), 5.0)


NAMED = {
    scenario.name: scenario
    for scenario in (
        _from("spin", "20 m/s forward at a yaw rate of 6 rad/s", 20.0, 0.0, 6.0),
        _from("drift-left", "18 m/s forward and 10 m/s to the right, turning left", 18.0, -10.0, 1.5),
        _from("drift-right", "its mirror image", 18.0, 10.0, -1.5),
        _from("reverse-slide", "15 m/s backward", -15.0, 3.0, 1.0),
        _from("fast-spin", "10 m/s forward at a yaw rate of -10 rad/s", 10.0, 5.0, -10.0),
    )
}
"""The five recoveries to 15 m/s straight on."""


def yaw_step(speed: float = 25.0, lateral: float = 8.0) -> Scenario:
    """From straight on at ``speed`` m/s into a turn at ``lateral`` m/s² at once, at half a second."""
    about = f"yaw rate step to {lateral:g} m/s² at {speed:g} m/s"
    x0 = np.array([[speed, 0.0, 0.0]])
    return Scenario("yaw-step", about, x0, 2.5, YawStep(speed, lateral), tracking=True)


def lane_change(speed: float = 25.0, lateral: float = 8.0) -> Scenario:
    """A double lane change at ``speed`` m/s with sines of ``lateral`` m/s², from half a second on."""
    about = f"double lane change with {lateral:g} m/s² at {speed:g} m/s"
    x0 = np.array([[speed, 0.0, 0.0]])
    return Scenario("lane-change", about, x0, 4.5, LaneChange(speed, lateral), tracking=True)


def random(
    vehicle: VehicleParameters, seed: int = SEED, count: int = DRAWN, energy: float = ENERGY, seconds: float = 5.0
) -> Scenario:
    """The first ``count`` of max(200, count) states uniform in the volume of kinetic ``energy`` J, drawn at once."""
    if count < 1:
        raise InvalidValueError(f"'count' must be at least 1, got {count}: give how many states are drawn")
    x0 = ball(seed, max(DRAWN, count))[:count] * semi_axes(energy, vehicle.m, vehicle.Jzz)
    return Scenario("random", f"{count} states within {energy / 1e3:g} kJ, seed {seed}", x0, seconds)


def own(
    x0: Sequence[float],
    seconds: float,
    reference: Sequence[float] | Sequence[Sequence[float]] = (15.0, 0.0, 0.0),
) -> Scenario:
    """A user's own: one ``x0`` of v_x, v_y, yaw rate, and a ``reference`` that stays or rows of t, v_x, v_y, yaw rate.

    Raises ``InvalidValueError`` for numbers that do not fit.
    """
    start = np.asarray(x0, dtype=float)
    if start.shape != (3,) or not np.isfinite(start).all():
        raise InvalidValueError(f"'x0' must be v_x, v_y, yaw_rate in m/s, m/s, rad/s, got {list(x0)}")
    if not (np.isfinite(seconds) and seconds > 0):
        raise InvalidValueError(f"'seconds' must be above 0, got {seconds}: give how long the loop runs")
    follows = reference_of(reference)
    tracking = not isinstance(follows, Constant)
    return Scenario("own", "as given", start[np.newaxis], float(seconds), follows, tracking)


def lasting(scenario: Scenario, seconds: float) -> Scenario:
    """The ``scenario`` for so many ``seconds``."""
    return replace(scenario, seconds=seconds)


SCENARIOS: dict[str, Callable[[VehicleParameters], Scenario]] = {
    **{name: (lambda vehicle, scenario=scenario: scenario) for name, scenario in NAMED.items()},  # type: ignore[misc]
    "random": random,
    "yaw-step": lambda vehicle: yaw_step(),
    "lane-change": lambda vehicle: lane_change(),
}
"""Every scenario by name, for a vehicle, at its defaults."""
