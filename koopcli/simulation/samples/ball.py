"""Test states in the volume inside Γ."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from koopcli.choices import SEED_LIMIT, setting, taken_from
from koopcli.progress import Progress
from koopcli.simulation import sampling
from koopcli.simulation.samples.sample import ENERGY, LARGEST, Drawn, SampleChoice
from koopcli.vehicles.plants.slips import Slips


@dataclass(frozen=True, kw_only=True)
class BallSample(SampleChoice):
    """Test states uniform in the volume inside Γ, without inputs."""

    kind: ClassVar[str] = "ball"
    meant_for = Slips
    tests = True
    seed: int = setting(0, low=0, high=SEED_LIMIT, option=True, help="seed of every draw")
    count: int = setting(2000, low=1, high=100_000_000, option=True, help="number of states")
    energy: float = setting(ENERGY, above=0, high=LARGEST, unit="J", option=True, help="largest kinetic energy")
    steps: int = setting(50, low=1, high=1_000_000, option=True, help="steps of each trajectory")
    m: float = taken_from("vehicle")
    Jzz: float = taken_from("vehicle")

    def sampled(self, progress: Progress) -> Drawn:
        """States uniform in the volume."""
        return self.calm(sampling.ball(self.seed, self.count) * sampling.semi_axes(self.energy, self.m, self.Jzz))
