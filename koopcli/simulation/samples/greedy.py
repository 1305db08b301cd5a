"""States inside Γ, each where data are missing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from koopcli.choices import SEED_LIMIT, setting, taken_from
from koopcli.errors import InvalidValueError
from koopcli.progress import Progress
from koopcli.records import FloatArray
from koopcli.simulation import designs, sampling
from koopcli.simulation.integrate import simulate
from koopcli.simulation.samples.sample import ENERGY, LARGEST, Drawn, SampleChoice
from koopcli.vehicles.axles import Combined
from koopcli.vehicles.parameters import VehicleParameters
from koopcli.vehicles.plants.slips import SlipInput, Slips
from koopcli.vehicles.symmetry import Mirror, images


@dataclass(frozen=True, kw_only=True)
class GreedySample(SampleChoice):
    """States inside Γ, each the farthest from the data that trajectories from those before it give."""

    kind: ClassVar[str] = "greedy"
    meant_for = Slips
    seed: int = setting(0, low=0, high=SEED_LIMIT, option=True, help="seed of the candidates")
    budget: float = setting(
        441.0, above=0, high=1e9, unit="s", option=True, help="simulated seconds of all trajectories together"
    )
    steps: int = setting(100, low=1, high=1_000_000, option=True, help="steps of each trajectory")
    usable: float = setting(0.5, above=0, high=1e6, unit="s", help="length of each trajectory that counts as data")
    candidates: int = setting(20_000, low=1, high=10_000_000, help="states to choose from, uniform in the volume")
    mirror: tuple[Mirror, ...] = setting(
        (), unique=True, empty=True, option=True, help="mirror images that count as data too"
    )
    energy: float = setting(ENERGY, above=0, high=LARGEST, unit="J", option=True, help="largest kinetic energy")
    vehicle: VehicleParameters = taken_from("simulate")
    dt: float = taken_from("simulate")
    v_eps: float = taken_from("simulate")
    combined: Combined = taken_from("simulate")

    @property
    def m(self) -> float:
        """Mass in kg."""
        return self.vehicle.m

    @property
    def Jzz(self) -> float:
        """Yaw inertia in kg m²."""
        return self.vehicle.Jzz

    @property
    def count(self) -> int:  # type: ignore[override]
        """How many trajectories the budget pays for."""
        return int(self.budget / (self.steps * self.dt) + 1e-9)

    @property
    def seconds(self) -> float:
        """About how long the search takes."""
        trees = self.count / designs.BATCH * (self.candidates + self.count * self.usable / self.dt) * 5e-7
        return trees + self.count * self.candidates * 3e-7 + 1e-5 * self.count * self.steps

    def check(self) -> None:
        """Raise ``InvalidValueError`` for a budget that pays for no trajectory, or for more than there are candidates,
        and for a mirror that the vehicle has not.
        """
        images(self.mirror, self.vehicle, self._plant.states.names)
        length = self.steps * self.dt
        if self.count < 1:
            raise InvalidValueError(
                f"'sample.budget' of {self.budget:g} s does not pay for one trajectory of {length:g} s"
            )
        if self.count > self.candidates:
            raise InvalidValueError(
                f"'sample.budget' of {self.budget:g} s pays for {self.count:,} trajectories, more than the states to "
                f"choose from: raise sample.candidates from {self.candidates:,}"
            )
        if self.usable > length:
            raise InvalidValueError(f"'sample.usable' of {self.usable:g} s is longer than trajectories of {length:g} s")

    def sampled(self, progress: Progress) -> Drawn:
        """One state after another, simulating as it goes."""
        plant, steps = self._plant, round(self.usable / self.dt)
        semi_axes = sampling.semi_axes(self.energy, self.m, self.Jzz)
        u = np.zeros((designs.BATCH, min(self.steps, steps), len(plant.inputs)))

        def flow(x0: FloatArray) -> FloatArray:
            return simulate(plant.rhs, x0, u[: len(x0)], self.dt, fastest_rate=plant.fastest_rate)

        states = designs.fill(
            sampling.ball(self.seed, self.candidates) * semi_axes,
            self.count,
            flow,
            steps + 1,
            images(self.mirror, self.vehicle, plant.states.names),
            lambda x: np.asarray(x / semi_axes),
            progress,
        )
        return self.calm(states)

    @property
    def _plant(self) -> SlipInput:
        return SlipInput(self.vehicle, self.v_eps, self.combined)
