"""One initial state with inputs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from koopcli.choices import SEED_LIMIT, setting
from koopcli.errors import InvalidValueError
from koopcli.progress import Progress
from koopcli.simulation import sampling
from koopcli.simulation.samples.sample import LARGEST, Drawn, Excitation, SampleChoice
from koopcli.vehicles.plants.forces import Forces


@dataclass(frozen=True)
class PointSample(SampleChoice):
    """One initial state with inputs: the paper's single trajectory."""

    kind: ClassVar[str] = "point"
    meant_for = Forces
    tests = True
    seed: int = setting(0, low=0, high=SEED_LIMIT, option=True, help="seed of the inputs")
    x0: tuple[float, ...] = setting(
        (20.8533, -0.7222, -4.3479), low=-LARGEST, high=LARGEST, help="initial state: m/s, m/s, rad/s"
    )
    excitation: Excitation = setting("fresh", option=True, help="inputs: none, fresh at each step, or held")
    amplitude: float = setting(
        1e4, low=0, high=LARGEST, unit="N", option=True, help="inputs are uniform in ± amplitude"
    )
    steps: int = setting(300, low=1, high=1_000_000, option=True, help="steps of the trajectory")

    @property
    def driven(self) -> bool:
        """Whether inputs change within or between its trajectories."""
        return self.excitation != "none" and self.amplitude > 0

    @property
    def trajectories(self) -> int:
        """How many trajectories start from the sample."""
        return 1

    @property
    def input_steps(self) -> int | None:
        """Steps that the sample holds inputs for, None for any number."""
        return self.steps if self.excitation == "fresh" else None

    @property
    def numbers(self) -> int:
        """How many numbers the sample stores."""
        return len(self.x0) + 4 * (self.input_steps or 1)

    def settled(self) -> PointSample:
        """The same sample: an amplitude without inputs is reset to zero."""
        return replace(self, amplitude=0.0) if self.excitation == "none" else self

    def check(self) -> None:
        """Raise ``InvalidValueError`` for a state of other channels than the plant's."""
        names = self.meant_for.states.names
        if len(self.x0) != len(names):
            raise InvalidValueError(
                f"'test.point.x0' must have one value for each of {', '.join(names)}, got {self.x0}"
            )

    def sampled(self, progress: Progress) -> Drawn:
        """The state and its inputs."""
        generator, inputs = np.random.default_rng(self.seed), len(self.meant_for.inputs)
        u = sampling.excite(generator, self.excitation, self.amplitude, 1, self.steps, inputs)
        return Drawn(np.array([self.x0]), u)
