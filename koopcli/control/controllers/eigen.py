"""E: one linear system over the horizon, from eigenfunctions of the coasting car."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from koopcli.control.condense import EigenResponse, eigen_rows
from koopcli.control.control import Control
from koopcli.control.controllers.controller import BODY, OnForces, check_body, needed, samples_of
from koopcli.control.lifted import future_of
from koopcli.control.tyres import Tyres
from koopcli.errors import InvalidValueError
from koopcli.koopman.eigen.futures import Futures
from koopcli.koopman.predictor.dynamics.diagonal import Diagonal
from koopcli.koopman.predictor.predictor import Predictor, check_horizon
from koopcli.vehicles.body import STATES
from koopcli.vehicles.parameters import VehicleParameters


@dataclass(frozen=True, kw_only=True)
class EigenControl(OnForces):
    """Linear predictive control on eigenfunctions: A from the fit, B = (∂ψ/∂x) G at the measured state."""

    kind: ClassVar[str] = "eigen"
    about: ClassVar[str] = "make one with koop fit-eigen --experiment quick-eigen --vehicle …"
    dynamics: ClassVar[tuple[str, ...]] = (Diagonal.kind, "force-driven")

    def of(self, vehicle: VehicleParameters, predictor: Predictor | None = None) -> Control:
        """The controller; its ``predictor`` is one of the coasting ``vehicle``. Raises as :class:`ControllerChoice`."""
        fit = needed(predictor, EigenControl)
        lift, dynamics = fit.observables, fit.dynamics
        if not isinstance(lift, Futures) or not isinstance(dynamics, Diagonal):
            raise InvalidValueError(
                "the controller 'eigen' needs lifted states that are fitted to the horizon ahead, got "
                f"{type(lift).__name__}: {self.about}"
            )
        if fit.state_channels.names != STATES.names:
            raise InvalidValueError(
                f"the controller 'eigen' needs a predictor of {', '.join(STATES.names)}, got one of "
                f"{', '.join(fit.state_channels.names)}: {self.about}"
            )
        check_body(fit, vehicle, self.kind, (*BODY, "mu_scale", "lateral", "lateral_rear"))
        q = samples_of(self.h, fit.dt)
        check_horizon(self.steps * q, fit.horizon)
        tyres = self.tyres(vehicle)
        seen = eigen_rows(dynamics.modes.block, fit.C, lift.projection, fit.dt, q, self.steps)
        coasting = Tyres(vehicle, self.combined, float(fit.plant.get("v_eps", 0.1)))
        future = future_of(lift)
        response = EigenResponse(future, seen, coasting, tyres.body_matrix * tyres.scale)
        return self.planner(response, tyres)
