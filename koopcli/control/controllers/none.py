"""No control: the car coasts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from koopcli.control.control import FREE, TS, Plan, checked
from koopcli.control.controllers.controller import ControllerChoice
from koopcli.koopman.predictor.predictor import Predictor
from koopcli.records import FloatArray
from koopcli.vehicles.parameters import VehicleParameters


class Coasting:
    """Zero steer and slip."""

    facts = FREE
    plan: Plan | None = None
    times: FloatArray = np.array([TS])

    def reset(self) -> None:
        """There is nothing to forget."""

    def step(self, x: FloatArray, reference: FloatArray) -> FloatArray:
        """Zeros (4,). Raises ``InvalidValueError`` for shapes that do not fit and a state that is not finite."""
        checked(x, reference, 1)
        return np.zeros(4)


@dataclass(frozen=True, kw_only=True)
class NoControl(ControllerChoice):
    """The car coasts with straight wheels."""

    kind: ClassVar[str] = "none"
    about: ClassVar[str] = "zero steer and slip"
    solves: ClassVar[bool] = False

    def of(self, vehicle: VehicleParameters, predictor: Predictor | None = None) -> Coasting:
        """The controller, which knows nothing."""
        return Coasting()
