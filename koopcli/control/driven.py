"""The plants of a loop: what they do in one sample of ``TS`` seconds under steer and slip."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from koopcli.control.control import TS
from koopcli.errors import InvalidValueError
from koopcli.records import FloatArray, IntArray
from koopcli.simulation.integrate import LOST, STIFF, integrate
from koopcli.vehicles import tyre
from koopcli.vehicles.axles import Axles, Combined
from koopcli.vehicles.parameters import VehicleParameters
from koopcli.vehicles.plants.plant import Plant
from koopcli.vehicles.plants.slips import SlipInput
from koopcli.vehicles.plants.wheels import TorqueInput

WHEEL_SAMPLES = 5  # of the slip controller within a sample
WHEEL_TIME = 0.02  # s in which a rim comes to its speed
LARGEST_TORQUE = 2500.0  # N m of one wheel, to either side
LARGEST_SLIP = 0.9  # of a target, above which a rim speed would have no bound
SLOW = 0.5  # m/s along a wheel, below which slip is counted of this speed


FATES = {0: None, LOST: "left the finite numbers", STIFF: "would need steps too small to take"}
"""What may become of a plant within a sample."""


class Driven(Protocol):
    """Cars that are given steer and slip, n at once; rows are independent."""

    def start(self, x0: FloatArray) -> FloatArray:
        """The states of the plant (n, n_x) of cars that roll with their bodies at ``x0`` (n, 3)."""

    def advance(self, state: FloatArray, before: FloatArray, u: FloatArray) -> tuple[FloatArray, IntArray]:
        """The states (n, n_x) a sample later, under ``u`` (n, 4) after the inputs ``before`` (n, 4), and what became
        of each, (n,): a key of ``FATES``. Where that is not 0, the state is not a number.
        """


def _ahead(plant: Plant, state: FloatArray, u: FloatArray, dt: float) -> tuple[FloatArray, IntArray]:
    """One sample of a plant, and what became of each row."""
    after, course = integrate(plant.rhs, state, u[:, np.newaxis], dt, fastest_rate=plant.fastest_rate)
    return after[:, 1], course.reason


@dataclass(frozen=True, eq=False)
class SlipDriven:
    """The plant ``slips`` of a ``vehicle``, which has any slip at once."""

    vehicle: VehicleParameters
    combined: Combined = "ellipse"

    def start(self, x0: FloatArray) -> FloatArray:
        """The bodies alone, (n, 3)."""
        return np.array(x0, dtype=float)

    def advance(self, state: FloatArray, before: FloatArray, u: FloatArray) -> tuple[FloatArray, IntArray]:
        """As :meth:`Driven.advance`; slip and steer jump to ``u``."""
        return _ahead(self._plant, state, u, TS)

    @cached_property
    def _plant(self) -> SlipInput:
        return SlipInput(self.vehicle, combined=self.combined)


@dataclass(frozen=True, eq=False)
class WheelDriven:
    """The plant ``wheels`` of a ``vehicle`` with a slip controller every 2 ms, which knows the vehicle ``known``.

    Steer goes from the last command to the new one in five steps, each of which has the value of its end. Torque acts
    through ``drive`` to both sides.
    """

    vehicle: VehicleParameters
    known: VehicleParameters
    combined: Combined = "ellipse"

    def __post_init__(self) -> None:
        TorqueInput(self.vehicle, combined=self.combined)
        TorqueInput(self.known, combined=self.combined)

    def start(self, x0: FloatArray) -> FloatArray:
        """The bodies with wheels that roll at v_x, (n, 5)."""
        r_w = self._plant.parameters.r_w
        assert r_w is not None, "checked when the plant was made"
        return np.concatenate([x0, np.repeat(x0[:, :1] / r_w, 2, axis=1)], axis=1)

    def advance(self, state: FloatArray, before: FloatArray, u: FloatArray) -> tuple[FloatArray, IntArray]:
        """As :meth:`Driven.advance`."""
        inputs, fate = np.zeros((len(state), 6)), np.zeros(len(state), dtype=np.int64)
        for i in range(1, WHEEL_SAMPLES + 1):
            steer = before[:, 0::2] + i / WHEEL_SAMPLES * (u[:, 0::2] - before[:, 0::2])
            inputs[:, 0::3], inputs[:, 1::3] = steer, self.torque(state, steer, u[:, 1::2])
            state, now = _ahead(self._plant, state, inputs, TS / WHEEL_SAMPLES)
            fate = np.where(fate == 0, now, fate)
        return state, fate

    def torque(self, state: FloatArray, steer: FloatArray, slip: FloatArray) -> FloatArray:
        """What the slip controller gives a wheel of an axle in N m, (n, 2), at ``state`` (n, 5) for ``slip`` (n, 2)."""
        axles, p = self._axles, self.known
        assert p.r_w is not None, "checked when the plant was made"
        assert p.J_R is not None, "checked when the plant was made"
        w_x, w_y = axles.velocities(state[:, :3], steer)
        along = axles.forces(tyre.slip_angle(w_x, w_y, SLOW), slip)[0] / 2
        spin = rim_speed(w_x, slip) / p.r_w - state[:, 3:]
        return np.clip(p.r_w * along + p.J_R * spin / WHEEL_TIME, -LARGEST_TORQUE, LARGEST_TORQUE)

    @cached_property
    def _plant(self) -> TorqueInput:
        return TorqueInput(self.vehicle, combined=self.combined)

    @cached_property
    def _axles(self) -> Axles:
        return Axles(self.known, SLOW, self.combined)


def rim_speed(w: FloatArray, slip: FloatArray) -> FloatArray:
    """The rim speed in m/s that is ``slip`` faster than a wheel with the speed ``w`` along itself, same shapes."""
    size = np.abs(slip)
    fast = np.where(slip * w > 0, w / (1 - np.minimum(size, LARGEST_SLIP)), w * (1 - size))
    return np.asarray(np.where(np.abs(w) < SLOW, w + SLOW * slip, fast))


def driven(
    plant: str, vehicle: VehicleParameters, known: VehicleParameters | None = None, combined: Combined = "ellipse"
) -> Driven:
    """The plant of a loop by name, ``slips`` or ``wheels``; ``known``: what a slip controller takes the vehicle for.

    Raises ``InvalidValueError`` for another name, and for a vehicle that lacks what the plant needs.
    """
    if plant == "slips":
        return SlipDriven(vehicle, combined)
    if plant == "wheels":
        return WheelDriven(vehicle, known or vehicle, combined)
    raise InvalidValueError(f"a loop is closed on the plants 'slips' and 'wheels', got '{plant}': choose one of them")
