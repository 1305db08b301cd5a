"""F: a generator in which axle forces multiply the lifted state, re-evaluated along the plan."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from koopcli.control.condense import GeneratorResponse
from koopcli.control.control import Control
from koopcli.control.controllers.controller import OnForces, check_body, needed
from koopcli.errors import InvalidValueError
from koopcli.koopman.predictor.dynamics.generator import Generator
from koopcli.koopman.predictor.predictor import Predictor
from koopcli.vehicles.parameters import VehicleParameters
from koopcli.vehicles.plants.forces import WHEELS_PER_FORCE, ForceInput


@dataclass(frozen=True, kw_only=True)
class GeneratorControl(OnForces):
    """Predictive control on a generator with axle forces as inputs, linearised along the plan."""

    kind: ClassVar[str] = "generator"
    about: ClassVar[str] = "make one with koop fit-edmd --basis anisotropic --order 8 --terms generator"
    dynamics: ClassVar[tuple[str, ...]] = (Generator.kind,)

    def of(self, vehicle: VehicleParameters, predictor: Predictor | None = None) -> Control:
        """The controller; its ``predictor`` is one of the plant ``forces``. Raises as :class:`ControllerChoice`."""
        fit = needed(predictor, GeneratorControl)
        dynamics = fit.dynamics
        channels = fit.state_channels.names, fit.input_channels.names
        of_forces = channels == (ForceInput.states.names, ForceInput.inputs.names)
        if not isinstance(dynamics, Generator) or fit.needs_history or not of_forces:
            raise InvalidValueError(
                f"the controller 'generator' needs a predictor without memory of the plant 'forces', got one of "
                f"{', '.join(channels[0])} with the inputs {', '.join(channels[1])}: {self.about}"
            )
        check_body(fit, vehicle, self.kind)
        tyres = self.tyres(vehicle)
        per_input = tyres.scale / WHEELS_PER_FORCE[fit.plant.get("force_per", "axle")]
        K = np.concatenate([dynamics.K[:1], dynamics.K[1:] * per_input[:, np.newaxis, np.newaxis]])
        return self.planner(GeneratorResponse(fit.observables.lift, K, fit.C, self.h), tyres)
