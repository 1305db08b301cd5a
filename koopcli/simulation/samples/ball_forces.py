"""Test states in the volume inside Γ, with changes of axle forces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from koopcli.choices import SEED_LIMIT, setting, taken_from
from koopcli.progress import Progress
from koopcli.simulation import sampling
from koopcli.simulation.samples.sample import ENERGY, LARGEST, Drawn, SampleChoice
from koopcli.vehicles.axles import Axles
from koopcli.vehicles.parameters import VehicleParameters
from koopcli.vehicles.plants.slips_axle_forces import AxleForces, ForceChange

OF_FORCES = 1  # what is drawn of a seed beside the states


@dataclass(frozen=True, kw_only=True)
class BallForcesSample(SampleChoice):
    """Test states uniform in the volume inside Γ, with changes of axle forces at random."""

    kind: ClassVar[str] = "ball-forces"
    meant_for = AxleForces
    tests = True
    seed: int = setting(0, low=0, high=SEED_LIMIT, option=True, help="seed of every draw")
    count: int = setting(2000, low=1, high=100_000_000, option=True, help="number of states")
    energy: float = setting(ENERGY, above=0, high=LARGEST, unit="J", option=True, help="largest kinetic energy")
    grip_share: float = setting(
        0.4, above=0, high=2, unit="1", option=True, help="largest change of a force, in all the grip of its axle"
    )
    hold: int = setting(5, low=1, high=1_000_000, option=True, help="steps for which forces are held")
    steps: int = setting(30, low=1, high=1_000_000, option=True, help="steps of each trajectory")
    vehicle: VehicleParameters = taken_from("simulate")

    @property
    def driven(self) -> bool:
        """Whether inputs change within or between its trajectories."""
        return True

    @property
    def input_steps(self) -> int | None:
        """Steps that the sample holds inputs for."""
        return self.steps

    @property
    def numbers(self) -> int:
        """How many numbers the sample stores."""
        return self.count * (3 + 4 * self.steps)

    def check(self) -> None:
        """Raise ``InvalidValueError`` for a vehicle without tyres."""
        ForceChange(self.vehicle)

    def sampled(self, progress: Progress) -> Drawn:
        """The states of the kind ``ball``, and forces (count, steps, 4) in N: the share of the largest force of their
        axle, uniform to either side and drawn afresh every ``hold`` steps.
        """
        states = sampling.ball(self.seed, self.count) * sampling.semi_axes(
            self.energy, self.vehicle.m, self.vehicle.Jzz
        )
        largest = np.repeat(2 * Axles(self.vehicle, ForceChange.v_eps, ForceChange.combined).grip, 2)
        stretches = -(-self.steps // self.hold)
        drawn = np.random.default_rng([self.seed, OF_FORCES]).uniform(-1, 1, (self.count, stretches, 4))
        held = np.repeat(drawn, self.hold, axis=1)[:, : self.steps]
        return Drawn(states, self.grip_share * largest * held)
