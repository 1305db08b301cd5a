"""Γ: states of one kinetic energy."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

from koopcli.choices import setting, taken_from
from koopcli.progress import Progress
from koopcli.simulation import sampling
from koopcli.simulation.samples.sample import ENERGY, LARGEST, Drawn, SampleChoice
from koopcli.vehicles.plants.slips import Slips


@dataclass(frozen=True, kw_only=True)
class EllipsoidSample(SampleChoice):
    """Γ: states of one kinetic energy, the surface that trajectories of the eigenfunction method start from."""

    kind: ClassVar[str] = "ellipsoid"
    meant_for = Slips
    mesh: Literal["sphere", "fibonacci"] = setting(
        "sphere", option=True, help="points on the surface: latitudes × longitudes, or a spiral"
    )
    count: int = setting(
        441, low=10, high=1_000_000, option=True, help="number of states; a square for the mesh 'sphere'"
    )
    shells: int = setting(1, low=1, high=1000, option=True, help="surfaces, of radii even from a quarter to the whole")
    energy: float = setting(ENERGY, above=0, high=LARGEST, unit="J", option=True, help="(largest) kinetic energy")
    steps: int = setting(150, low=1, high=1_000_000, option=True, help="steps of each trajectory")
    m: float = taken_from("vehicle")
    Jzz: float = taken_from("vehicle")

    @property
    def trajectories(self) -> int:
        """How many trajectories start from the sample."""
        return self.count * self.shells

    @property
    def numbers(self) -> int:
        """How many numbers the sample stores."""
        return 7 * self.trajectories

    def check(self) -> None:
        """Raise ``InvalidValueError`` for a number of states that the mesh cannot have."""
        sampling.check_mesh(self.mesh, self.count)

    def sampled(self, progress: Progress) -> Drawn:
        """The points of the mesh on every surface."""
        points = sampling.shells(sampling.MESHES[self.mesh](self.count), self.shells)
        return self.calm(points * sampling.semi_axes(self.energy, self.m, self.Jzz))
