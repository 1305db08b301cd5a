"""Every state of a grid with every input column: the dataset of EDMD."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from koopcli.choices import SEED_LIMIT, setting
from koopcli.progress import Progress
from koopcli.simulation import sampling
from koopcli.simulation.samples.sample import BOX, LARGEST, Drawn, SampleChoice, check_box
from koopcli.vehicles.plants.forces import Forces


@dataclass(frozen=True)
class GridSample(SampleChoice):
    """The EDMD dataset: every state of a grid with every input column."""

    kind: ClassVar[str] = "grid"
    meant_for = Forces
    seed: int = setting(0, low=0, high=SEED_LIMIT, option=True, help="seed of every draw")
    count: int = setting(15, low=1, high=10_000, option=True, help="values per state")
    draw: Literal["random", "even", "chebyshev"] = setting(
        "random", option=True, help="how the values of a state are chosen"
    )
    box: tuple[float, ...] = setting(BOX, low=1e-6, high=LARGEST, help="half-width per state: m/s, m/s, rad/s")
    levels: tuple[float, ...] = setting((1.0, 5.0, 10.0, 100.0), low=0, high=LARGEST, unit="N", help="input ranges F_m")
    columns: int = setting(15, low=1, high=100_000, help="input columns per range")

    @property
    def driven(self) -> bool:
        """Whether inputs change within or between its trajectories."""
        return max(self.levels) > 0 and len(self.levels) * self.columns > 1

    @property
    def trajectories(self) -> int:
        """How many trajectories start from the sample."""
        return int(self.count ** len(self.box)) * len(self.levels) * self.columns

    @property
    def horizon(self) -> int:
        """Steps of each trajectory unless told otherwise."""
        return 1

    @property
    def numbers(self) -> int:
        """How many numbers the sample stores."""
        return self.count * len(self.box) + 4 * len(self.levels) * self.columns

    def check(self) -> None:
        """Raise ``InvalidValueError`` for a box of another number of states."""
        check_box(self.box, self.meant_for.states)

    @property
    def label(self) -> str:
        """What data from it are called."""
        return f"{self.draw} {self.seed}"

    def sampled(self, progress: Progress) -> Drawn:
        """The values of each state, and the inputs of every level."""
        inputs = len(self.meant_for.inputs)
        factors, u = sampling.grid(self.seed, self.box, self.count, self.draw, self.levels, self.columns, inputs)
        return Drawn(np.empty((0, len(self.box))), u, factors)
