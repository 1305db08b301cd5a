"""What a choice of a controller is, and the settings that several kinds share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from koopcli.choices import Choice, setting
from koopcli.control import limits
from koopcli.control.attainable import Attainable
from koopcli.control.condense import Response
from koopcli.control.control import Control
from koopcli.control.limits import Limits
from koopcli.control.planner import Costs, Planner
from koopcli.control.realise import Inverse
from koopcli.control.tyres import Tyres
from koopcli.errors import InvalidValueError
from koopcli.koopman.predictor.predictor import Predictor
from koopcli.vehicles.axles import COMBINED_HELP, Combined
from koopcli.vehicles.parameters import VehicleParameters

RECOVERY = (1 / 5**2, 1 / 2**2, 1.0)  # Bryson: errors of 5 m/s, 2 m/s and 1 rad/s weigh the same
TRACKING = (1 / 5**2, 1.0, 25.0)
TRACKING_FRONT = (1 / 5**2, 0.02, 25.0)  # front steer alone cannot hold v_y and the yaw rate at once
BODY = ("m", "Jzz", "l_f", "l_r")


class ControllerChoice(Choice):
    """A kind of controller with its settings."""

    about: ClassVar[str]
    """What it is, in a few words."""
    dynamics: ClassVar[tuple[str, ...]] = ()
    """Which dynamics the predictor that it needs may have, by their kinds; none: it needs no predictor."""
    solves: ClassVar[bool] = True
    """Whether it solves a quadratic programme a step and needs daqp."""

    def of(self, vehicle: VehicleParameters, predictor: Predictor | None = None) -> Control:
        """The controller of a ``vehicle`` as it is known, with a ``predictor`` where one is needed.

        Raises ``InvalidValueError`` for a vehicle without tyres, a predictor that is missing or does not fit, and
        where daqp is not installed and needed.
        """
        raise NotImplementedError


@dataclass(frozen=True, kw_only=True)
class Bounded(ControllerChoice):
    """What steer and slip may do."""

    steer: float = setting(limits.STEER, above=0, high=1.5, unit="rad", help="largest steer angle of the front wheels")
    steer_rear: float = setting(
        limits.STEER, low=0, high=1.5, unit="rad", help="that of the rear wheels; 0: front steer only"
    )
    slip: float = setting(limits.SLIP, above=0, high=0.9, unit="1", help="largest slip of a wheel along itself")
    steer_rate: float = setting(limits.STEER_RATE, above=0, high=1e3, unit="rad/s", help="largest rate of steer")
    slip_rate: float = setting(limits.SLIP_RATE, above=0, high=1e3, unit="1/s", help="largest rate of slip")

    @property
    def limits(self) -> Limits:
        """The bounds and rates."""
        return Limits(self.steer, self.steer_rear, self.slip, self.steer_rate, self.slip_rate)


@dataclass(frozen=True, kw_only=True)
class Weighted(Bounded):
    """What a controller that plans ahead weighs, and the tyres it plans with."""

    weights: tuple[float, float, float] = setting(
        RECOVERY, low=0, high=1e9, help="of squared errors of v_x (s²/m²), v_y (s²/m²) and yaw rate (s²/rad²)"
    )
    last: float = setting(5.0, low=0, high=1e6, unit="1", help="how many times over the last error weighs")
    effort: float = setting(1e-3, above=0, high=1e6, unit="1/s", help="weight of squared decisions")
    change: float = setting(2e-3, above=0, high=1e6, unit="1", help="weight of their squared changes")
    combined: Combined = setting("ellipse", help=COMBINED_HELP)
    v_eps: float = setting(1.0, above=0, high=100, unit="m/s", help="a wheel slower than this counts as that fast")

    @property
    def costs(self) -> Costs:
        """The weights."""
        return Costs(self.weights, self.last, self.effort, self.change)

    def tyres(self, vehicle: VehicleParameters) -> Tyres:
        """The axle forces that the controller knows."""
        return Tyres(vehicle, self.combined, self.v_eps)


@dataclass(frozen=True, kw_only=True)
class OnForces(Weighted):
    """A plan of axle forces within what steer and slip can give, and its inverse."""

    steps: int = setting(10, low=2, high=200, help="prediction steps of the horizon")
    h: float = setting(0.05, above=0, high=1, unit="s", help="length of a prediction step")
    look_ahead: float = setting(
        0.1, low=0, high=10, unit="s", help="how much longer than it has, steer may turn in what forces can be had"
    )
    directions: int = setting(12, low=4, high=64, help="sides of a polygon of forces; even")
    attainable: tuple[int, int] = setting((13, 5), low=2, high=1000, help="steer and slip values of a polygon's grid")
    inverse: tuple[int, int] = setting((25, 13), low=2, high=1000, help="those of the grid that forces are sought in")

    def planner(self, response: Response, tyres: Tyres) -> Planner:
        """The controller that predicts by ``response``."""
        limits = self.limits
        attainable = Attainable(
            tyres, limits, self.steps, self.h, self.look_ahead, self.directions, pair(self.attainable)
        )
        return Planner(response, tyres, limits, attainable, Inverse(tyres, limits, pair(self.inverse)), self.costs)


def pair(values: Sequence[int]) -> tuple[int, int]:
    """Two numbers as a tuple, which settings from a file are not."""
    first, second = values
    return first, second


def needed(predictor: Predictor | None, kind: type[ControllerChoice]) -> Predictor:
    """The ``predictor`` that a controller of ``kind`` needs. Raises ``InvalidValueError`` where it is another."""
    if predictor is None:
        raise InvalidValueError(f"the controller '{kind.kind}' needs a predictor: {kind.about}")
    dynamics = predictor.dynamics.kind
    if dynamics not in kind.dynamics:
        wanted = "' or '".join(kind.dynamics)
        raise InvalidValueError(
            f"the controller '{kind.kind}' needs a predictor with the dynamics '{wanted}', got "
            f"'{dynamics}': {kind.about}"
        )
    return predictor


def check_body(predictor: Predictor, vehicle: VehicleParameters, kind: str, names: Sequence[str] = BODY) -> None:
    """Raise ``InvalidValueError`` for a predictor of another body than the ``vehicle`` that the controller knows."""
    of = predictor.plant.get("vehicle", {})
    for name in names:
        if name in of and of[name] != written_as(getattr(vehicle, name)):
            raise InvalidValueError(
                f"the predictor was identified with {name} = {of[name]}, the controller '{kind}' knows a vehicle "
                f"with {getattr(vehicle, name)}: identify one on that"
            )


def written_as(value: object) -> object:
    """A parameter as a predictor remembers it: a tyre by its coefficients."""
    return vars(value) if hasattr(value, "__dataclass_fields__") else value


def samples_of(h: float, dt: float) -> int:
    """How many samples of ``dt`` s a step of ``h`` s has. Raises ``InvalidValueError`` if that is no whole number."""
    q = int(np.rint(h / dt))
    if q < 1 or abs(q * dt - h) > 1e-9 * h:
        raise InvalidValueError(
            f"a prediction step of {h:g} s is no multiple of the predictor's {dt:g} s: set 'h' to one"
        )
    return q
