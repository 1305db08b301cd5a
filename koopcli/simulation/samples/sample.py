"""What a kind of sample is, and what the settings of several have in common."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar, Literal, NamedTuple, Self

import numpy as np

from koopcli.choices import Choice
from koopcli.errors import InvalidValueError
from koopcli.progress import Progress
from koopcli.records import Channels, FloatArray
from koopcli.vehicles.plants.plant import PlantChoice

Excitation = Literal["none", "fresh", "held"]

INPUTS = {"none": "no input", "fresh": "fresh inputs", "held": "held inputs"}  # kinds of excitation in words
BOX = (30.0, 30.0, 10.0)
ENERGY = 500e3
LARGEST = 1e12  # of any physical quantity: squares and sums of it stay far inside the floating-point range


class Drawn(NamedTuple):
    """What a sample holds: ``states`` (n, n_x) and ``inputs`` (n, steps or 1, n_u); of a product of every state with
    every input the ``factors``, the values of each state, instead of states.
    """

    states: FloatArray
    inputs: FloatArray
    factors: tuple[FloatArray, ...] = ()


class SampleChoice(Choice):
    """What every kind of sample tells of itself; a kind says only what is different."""

    afresh = True
    meant_for: ClassVar[type[PlantChoice]]
    """The plant whose inputs it holds."""
    tests: ClassVar[bool] = False
    """Whether it may be a test set."""
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

    @property
    def label(self) -> str:
        """What data from it are called."""
        return self.kind

    @property
    def seconds(self) -> float:
        """About how long it takes to draw, beside what its numbers cost."""
        return 0.0

    def check(self) -> None:
        """Raise ``InvalidValueError`` for settings that do not go together, or not with the vehicle."""

    def sampled(self, progress: Progress) -> Drawn:
        """Draw or lay out the states and inputs."""
        raise NotImplementedError

    def calm(self, states: FloatArray) -> Drawn:
        """``states`` (n, n_x) without inputs."""
        return Drawn(states, np.zeros((len(states), 1, len(self.meant_for.inputs))))


def check_box(box: Sequence[float], states: Channels) -> None:
    """Raise ``InvalidValueError`` for a ``box`` with other than one half-width for each of the ``states``."""
    if len(box) != len(states):
        names = ", ".join(states.names)
        raise InvalidValueError(f"'sample.box' must have one half-width for each of {names}, got {box}")
