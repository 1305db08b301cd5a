"""What the settings of all kinds of sample have in common."""

from __future__ import annotations

from typing import Literal, Self

Kind = Literal["grid", "box", "point", "ellipsoid", "greedy", "ball", "drive", "drive-test", "manoeuvre"]
Draw = Literal["random", "even", "chebyshev"]
Layout = Literal["uniform", "product"]
Mesh = Literal["sphere", "fibonacci"]
Excitation = Literal["none", "fresh", "held"]
Mirror = Literal["left-right", "front-rear"]

INPUTS = {"none": "no input", "fresh": "fresh inputs", "held": "held inputs"}  # kinds of excitation in words
BOX = (30.0, 30.0, 10.0)
ENERGY = 500e3
SEED_LIMIT = 2**63 - 1
LARGEST = 1e12  # of any physical quantity: squares and sums of it stay far inside the floating-point range


class Sampled:
    """What every kind of sample tells of itself; a kind says only what is different."""

    count: int
    steps: int

    @property
    def trajectories(self) -> int:
        """How many trajectories start from the sample."""
        return self.count

    @property
    def horizon(self) -> int:
        """Steps of each trajectory unless told otherwise."""
        return self.steps

    @property
    def input_steps(self) -> int | None:
        """Steps that the sample holds inputs for, None for any number."""
        return None

    @property
    def driven(self) -> bool:
        """Whether inputs change within or between its trajectories."""
        return False

    @property
    def numbers(self) -> int:
        """How many numbers the sample stores."""
        return 7 * self.count

    def settled(self) -> Self:
        """The same sample: settings that have no effect are reset, so that they are not in the key."""
        return self
