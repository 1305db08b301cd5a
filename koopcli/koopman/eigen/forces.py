"""Axle forces as inputs of a predictor of the coasting car, without any fit (docs/equations.md 7)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from koopcli.choices import Choice, setting
from koopcli.errors import InvalidValueError
from koopcli.koopman.eigen.futures import Futures
from koopcli.koopman.eigen.lookup.lookup import Lift, no_slopes
from koopcli.koopman.predictor.dynamics.diagonal import Diagonal
from koopcli.koopman.predictor.dynamics.force_driven import INPUT_MATRICES, ForceDriven, InputMatrix
from koopcli.koopman.predictor.predictor import Predictor
from koopcli.records import Channels, FloatArray
from koopcli.vehicles import body
from koopcli.vehicles.parameters import VehicleParameters
from koopcli.vehicles.plants import remembered_plant

CHANGES = Channels(("dF_fx", "dF_fy", "dF_rx", "dF_ry"), ("N",) * 4)
"""The inputs: how the body-fixed forces of both wheels of an axle differ from those of the coasting car."""


def force_matrix(vehicle: VehicleParameters) -> FloatArray:
    """G (3, 4) of ẋ = f(x) + G ΔF (7.23): what a force in N changes in the derivative of [v_x, v_y, yaw_rate].

    In 1/kg, and 1/(kg m) in the row of the yaw rate; ΔF = [F_fx, F_fy, F_rx, F_ry] less those of the coasting car, in
    body axes, of both wheels of an axle together. Exact, whatever the tyres are.
    """
    along, turning = 1 / vehicle.m, np.array([vehicle.l_f, -vehicle.l_r]) / vehicle.Jzz
    G = np.zeros((3, 4))
    G[0, 0::2] = G[1, 1::2] = along
    G[2, 1::2] = turning
    return G


def with_forces(
    predictor: Predictor, vehicle: VehicleParameters, input_matrix: InputMatrix = "every", every: int = 5
) -> Predictor:
    """A ``predictor`` of a coasting ``vehicle`` with the inputs ``CHANGES``: changes of its axle forces in N.

    ``input_matrix``: where B = (∂ψ/∂x) G is taken: at the ``first`` state; again ``every`` so many samples; at both
    ends of as many and linear ``between``, which errs least; or after each sample, where the state is lifted afresh
    (``relift``), which may go on beyond the horizon. Nothing is fitted. An estimate of errors is left out, since it is
    one of coasting.
    Raises ``InvalidValueError`` for a predictor that is none of ``fit-eigen`` with splines over the horizon ahead, for
    other states than [v_x, v_y, yaw_rate], and for an ``input_matrix`` or ``every`` that it does not know.
    """
    lift, dynamics = predictor.observables, predictor.dynamics
    if not isinstance(lift, Futures) or not isinstance(dynamics, Diagonal):
        raise InvalidValueError(
            "force inputs need a predictor of fit-eigen whose lifted states are fitted to the horizon ahead, got "
            f"{type(lift).__name__}: fit with the experiment best-eigen or quick-eigen (fit-eigen.window=horizon)"
        )
    check_smooth(lift.nodes.search.lift)
    check_body(predictor.state_channels)
    if input_matrix not in INPUT_MATRICES:
        raise InvalidValueError(f"'input_matrix' must be one of {', '.join(INPUT_MATRICES)}, got {input_matrix!r}")
    if isinstance(every, bool) or not isinstance(every, int) or every < 1:
        raise InvalidValueError(f"'every' must be a whole number of samples from 1 on, got {every!r}")
    driven = ForceDriven(dynamics.modes, len(CHANGES), force_matrix(vehicle), input_matrix, every)
    horizon = None if input_matrix == "relift" else lift.horizon
    return replace(predictor, dynamics=driven, input_channels=CHANGES, horizon=horizon, trust=None, limits=None)


def check_smooth(lift: Lift) -> None:
    """Raise ``InvalidValueError`` for a ``lift`` without a derivative in the state."""
    if not lift.smooth:
        raise no_slopes(lift)


def check_body(states: Channels) -> None:
    """Raise ``InvalidValueError`` for other ``states`` than those of the body."""
    if states.names != body.STATES.names:
        raise InvalidValueError(
            f"force inputs act on the states {', '.join(body.STATES.names)}, got {', '.join(states.names)}: fit "
            "trajectories of the plant 'slips'"
        )


class Driven(Choice):
    """What moves the predicted car."""

    def check(self, ahead: bool, lift: Lift, states: Channels) -> None:
        """Raise ``InvalidValueError`` for a fit that these inputs do not go with: lifted states that are not fitted to
        the horizon ``ahead``, a ``lift`` without a derivative, and other ``states`` than the body's.
        """

    def horizon(self, steps: int | None) -> int | None:
        """The longest prediction, from that of the coasting predictor."""
        return steps

    def drive(self, predictor: Predictor, plant: Mapping[str, Any]) -> Predictor:
        """The coasting ``predictor`` of a ``plant``, as its trajectories remember it, with these inputs."""
        return predictor


@dataclass(frozen=True)
class Coasting(Driven):
    """Nothing: inputs have no effect."""

    kind: ClassVar[str] = "none"


@dataclass(frozen=True)
class DrivenByForces(Driven):
    """Changes of the axle forces, which act on the lifted state through its derivative."""

    kind: ClassVar[str] = "forces"
    input_matrix: InputMatrix = setting(
        "every",
        option=True,
        help="where that derivative is taken: at the first state; again every few samples; at both ends of those and "
        "linear between; or after each sample with the state lifted afresh",
    )
    every: int = setting(5, low=1, high=1_000_000, help="every, between: samples after which it is taken again")

    def check(self, ahead: bool, lift: Lift, states: Channels) -> None:
        """As told above."""
        if not ahead:
            raise InvalidValueError(
                "'fit-eigen.inputs' = 'forces' needs lifted states fitted to the horizon ahead: set "
                "fit-eigen.window=horizon, or take the experiment best-eigen or quick-eigen"
            )
        check_smooth(lift)
        check_body(states)

    def horizon(self, steps: int | None) -> int | None:
        """Any, where every state is lifted afresh."""
        return None if self.input_matrix == "relift" else steps

    def drive(self, predictor: Predictor, plant: Mapping[str, Any]) -> Predictor:
        """By the mass, the inertia and the arms of the vehicle. Raises ``InvalidValueError`` where it is not known."""
        if not plant:
            raise InvalidValueError(
                "force inputs need the mass, the yaw inertia and the arms of the vehicle, and these trajectories do "
                "not tell it: fit with fit-eigen.inputs=none, and give the vehicle to with_forces"
            )
        return with_forces(predictor, remembered_plant(plant).parameters, self.input_matrix, self.every)
