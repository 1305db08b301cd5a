"""Closing the loop on a predictor: controllers, the plants they drive, scenarios and what came of them."""

from __future__ import annotations

from typing import Any

from koopcli.checks import build
from koopcli.control.control import Control
from koopcli.control.controllers import CONTROLLERS
from koopcli.control.controllers.controller import ControllerChoice
from koopcli.control.controllers.eigen import EigenControl
from koopcli.control.controllers.generator import GeneratorControl
from koopcli.errors import InvalidValueError
from koopcli.koopman.predictor.predictor import Predictor
from koopcli.vehicles.parameters import VehicleParameters

__all__ = ["CONTROLLERS", "Control", "Controller", "ControllerChoice"]


def Controller(predictor: Predictor, vehicle: VehicleParameters, **settings: Any) -> Control:
    """The controller on a ``predictor`` for a ``vehicle``: E for eigenfunctions, F for a generator.

    ``settings``: those of the frozen class of its kind, such as ``steer_rear=0`` or ``weights``. Raises ``UsageError``
    for a setting that does not exist, ``InvalidValueError`` for one out of range and for a predictor of other dynamics,
    and as :meth:`ControllerChoice.of`.

    >>> control = Controller(predictor, vehicle)       # doctest: +SKIP
    >>> u = control.step(x, reference)                  # doctest: +SKIP
    """
    kinds: dict[str, type[ControllerChoice]] = {
        name: kind for kind in (EigenControl, GeneratorControl) for name in kind.dynamics
    }
    dynamics = predictor.dynamics.kind
    if dynamics not in kinds:
        raise InvalidValueError(
            f"no controller works on a predictor with the dynamics '{dynamics}': {GeneratorControl.about}, "
            f"or {EigenControl.about}"
        )
    return build(kinds[dynamics], settings).of(vehicle, predictor)
