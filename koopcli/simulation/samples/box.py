"""Test states in a box, with inputs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Literal

from koopcli.choices import SEED_LIMIT, setting
from koopcli.progress import Progress
from koopcli.simulation import sampling
from koopcli.simulation.samples.sample import BOX, LARGEST, Drawn, Excitation, SampleChoice, check_box
from koopcli.vehicles.plants.forces import Forces


@dataclass(frozen=True)
class BoxSample(SampleChoice):
    """Test states uniform in a box, with inputs."""

    kind: ClassVar[str] = "box"
    meant_for = Forces
    tests = True
    seed: int = setting(7, low=0, high=SEED_LIMIT, option=True, help="seed of every draw")
    count: int = setting(3375, low=1, high=100_000_000, option=True, help="number of states")
    excitation: Excitation = setting("fresh", option=True, help="inputs: none, fresh at each step, or held")
    amplitude: float = setting(
        1e4, low=0, high=LARGEST, unit="N", option=True, help="inputs are uniform in ± amplitude"
    )
    steps: int = setting(30, low=1, high=1_000_000, option=True, help="steps of each trajectory")
    box: tuple[float, ...] = setting(BOX, low=1e-6, high=LARGEST, help="half-width per state: m/s, m/s, rad/s")
    layout: Literal["uniform", "product"] = setting(
        "uniform", help="states uniform in the box, or the product of values drawn per state"
    )

    @property
    def driven(self) -> bool:
        """Whether inputs change within or between its trajectories."""
        return self.excitation != "none" and self.amplitude > 0

    @property
    def input_steps(self) -> int | None:
        """Steps that the sample holds inputs for, None for any number."""
        return self.steps if self.excitation == "fresh" else None

    @property
    def numbers(self) -> int:
        """How many numbers the sample stores."""
        return self.count * (len(self.box) + 4 * (self.input_steps or 1))

    def settled(self) -> BoxSample:
        """The same sample: an amplitude without inputs is reset to zero."""
        return replace(self, amplitude=0.0) if self.excitation == "none" else self

    def check(self) -> None:
        """Raise ``InvalidValueError`` for a box of other states, and for a count that is no product."""
        check_box(self.box, self.meant_for.states)
        if self.layout == "product":
            sampling.values_per_state(self.count, len(self.box))

    def sampled(self, progress: Progress) -> Drawn:
        """States of the layout, and inputs."""
        return Drawn(
            *sampling.box(
                self.seed,
                self.box,
                self.count,
                self.excitation,
                self.amplitude,
                self.steps,
                len(self.meant_for.inputs),
                self.layout,
            )
        )
