"""The controller of F with the equations of motion in place of a predictor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from koopcli.control.condense import RolledResponse
from koopcli.control.control import Control
from koopcli.control.controllers.controller import OnForces
from koopcli.koopman.predictor.predictor import Predictor
from koopcli.records import FloatArray
from koopcli.simulation.integrate import rk4_step
from koopcli.vehicles.parameters import VehicleParameters
from koopcli.vehicles.plants.forces import ForceInput

SUBSTEPS = 2  # of Runge and Kutta for a prediction step


@dataclass(frozen=True, kw_only=True)
class EquationsControl(OnForces):
    """Predictive control on the equations of the body: what a predictor is worth is what it adds to this one."""

    kind: ClassVar[str] = "equations"
    about: ClassVar[str] = "the body's equations of motion and their differences"

    def of(self, vehicle: VehicleParameters, predictor: Predictor | None = None) -> Control:
        """The controller, which has no use for a ``predictor``. Raises as :class:`ControllerChoice`."""
        tyres, body = self.tyres(vehicle), ForceInput(vehicle)
        h = self.h / SUBSTEPS

        def step(x: FloatArray, v: FloatArray) -> FloatArray:
            for _ in range(SUBSTEPS):
                x = rk4_step(body.rhs, x, v * tyres.scale, h)
            return x

        return self.planner(RolledResponse(step), tyres)
