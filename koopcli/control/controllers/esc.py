"""ESC: proportional control of yaw rate, side-slip angle and speed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from koopcli.choices import setting
from koopcli.control.control import FREE, TS, Plan, checked
from koopcli.control.controllers.controller import Bounded
from koopcli.control.limits import Limits
from koopcli.koopman.predictor.predictor import Predictor
from koopcli.records import FloatArray
from koopcli.vehicles.parameters import VehicleParameters

SLOWEST = 1.0  # m/s in the side-slip angle


class Proportional:
    """One car under control."""

    facts = FREE
    plan: Plan | None = None
    times: FloatArray = np.array([TS])

    def __init__(self, limits: Limits, yaw: float, side: float, speed: float) -> None:
        self._limits, self._gains = limits, (yaw, side, speed)
        self.reset()

    def reset(self) -> None:
        """The next step is the first one, at zero steer and slip."""
        self._u = np.zeros(4)

    def step(self, x: FloatArray, reference: FloatArray) -> FloatArray:
        """Inputs (4,) to hold for the next sample, at ``x`` (3,) with the ``reference`` (1, 3) or (3,).

        Raises ``InvalidValueError`` for shapes that do not fit and a state that is not finite.
        """
        x, reference = checked(x, reference, 1)
        yaw, side, speed = self._gains
        beta = math.atan2(x[1], max(abs(x[0]), SLOWEST))
        turn, slip = yaw * (reference[0, 2] - x[2]), speed * (reference[0, 0] - x[0])
        wanted = np.array([turn + side * beta, slip, -turn + side * beta, slip])
        self._u = self._limits.clip(wanted, self._u, TS)
        return self._u


@dataclass(frozen=True, kw_only=True)
class EscControl(Bounded):
    """Proportional control: steer against the errors of yaw rate and side-slip angle, slip by that of speed."""

    kind: ClassVar[str] = "esc"
    about: ClassVar[str] = "four-wheel steer and slip with proportional gains"
    solves: ClassVar[bool] = False
    gain_yaw: float = setting(0.12, low=0, high=1e3, unit="s", help="steer for an error of the yaw rate")
    gain_side: float = setting(0.5, low=0, high=1e3, unit="1", help="steer for a side-slip angle")
    gain_speed: float = setting(0.05, low=0, high=1e3, unit="s/m", help="slip for an error of the speed")

    def of(self, vehicle: VehicleParameters, predictor: Predictor | None = None) -> Proportional:
        """The controller, which knows nothing of the ``vehicle`` and has no use for a ``predictor``."""
        return Proportional(self.limits, self.gain_yaw, self.gain_side, self.gain_speed)
