"""LTV: the slip plant linearised once at the measured state and the inputs that act."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from koopcli.choices import setting
from koopcli.control.control import Control
from koopcli.control.controllers.controller import Weighted
from koopcli.control.linearised import Linearised
from koopcli.koopman.predictor.predictor import Predictor
from koopcli.vehicles.parameters import VehicleParameters


@dataclass(frozen=True, kw_only=True)
class OnSlips(Weighted):
    """A plan of steer and slip over the bounds of both."""

    steps: int = setting(20, low=2, high=200, help="prediction steps of the horizon")
    h: float = setting(0.025, above=0, high=1, unit="s", help="length of a prediction step")

    along: ClassVar[bool]

    def of(self, vehicle: VehicleParameters, predictor: Predictor | None = None) -> Control:
        """The controller, which has no use for a ``predictor``. Raises as :class:`ControllerChoice`."""
        return Linearised(self.tyres(vehicle), self.limits, self.costs, self.steps, self.h, self.along)


@dataclass(frozen=True, kw_only=True)
class LtvControl(OnSlips):
    """Predictive control on the slip plant, linearised once a step."""

    kind: ClassVar[str] = "ltv"
    about: ClassVar[str] = "the equations with tyres, linearised at the measured state"
    along: ClassVar[bool] = False
