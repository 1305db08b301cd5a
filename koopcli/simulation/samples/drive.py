"""States of cars under way on wheels, with torques and steer at random."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Self

from koopcli.choices import SEED_LIMIT, setting, taken_from
from koopcli.errors import InvalidValueError
from koopcli.progress import Progress
from koopcli.simulation import sampling
from koopcli.simulation.samples.sample import LARGEST, Drawn, Excitation, SampleChoice
from koopcli.vehicles.plants.wheels import Wheels

MAGNITUDES = ("torque", "steer", "steer_rear")  # of inputs


@dataclass(frozen=True, kw_only=True)
class Driven(SampleChoice):
    """States of a car under way on wheels that nearly roll, with torques and steer drawn for each trajectory."""

    meant_for = Wheels
    seed: int = setting(0, low=0, high=SEED_LIMIT, option=True, help="seed of every draw")
    count: int = setting(3375, low=1, high=100_000_000, option=True, help="number of states")
    slowest: float = setting(5.0, low=-LARGEST, high=LARGEST, unit="m/s", help="v_x at least; in reverse below zero")
    fastest: float = setting(30.0, low=-LARGEST, high=LARGEST, unit="m/s", help="v_x at most")
    v_y: float = setting(1.0, low=0, high=LARGEST, unit="m/s", help="|v_y| at most")
    yaw_rate: float = setting(0.3, low=0, high=LARGEST, unit="rad/s", help="|yaw rate| at most")
    slip: float = setting(
        0.02, low=0, high=1, unit="1", help="share of v_x that wheels turn faster or slower by, at most"
    )
    excitation: Excitation = setting("held", option=True, help="inputs: none, fresh at each step, or held")
    torque: float = setting(
        300.0, low=0, high=LARGEST, unit="N m", option=True, help="drive or brake torque of a wheel at most"
    )
    steer: float = setting(0.05, low=0, high=1.5, unit="rad", option=True, help="front steer at most, to either side")
    steer_rear: float = setting(0.01, low=0, high=1.5, unit="rad", help="rear steer at most, to either side")
    steps: int = setting(100, low=1, high=1_000_000, option=True, help="steps of each trajectory")
    r_w: float | None = taken_from("vehicle")

    @property
    def driven(self) -> bool:
        """Whether inputs change within or between its trajectories."""
        return self.excitation != "none" and any(getattr(self, name) > 0 for name in MAGNITUDES)

    @property
    def input_steps(self) -> int | None:
        """Steps that the sample holds inputs for, None for any number."""
        return self.steps if self.excitation == "fresh" else None

    @property
    def numbers(self) -> int:
        """How many numbers the sample stores."""
        return self.count * (len(Wheels.states) + len(Wheels.inputs) * (self.input_steps or 1))

    def settled(self) -> Self:
        """The same sample: magnitudes without inputs are reset to zero."""
        return replace(self, torque=0.0, steer=0.0, steer_rear=0.0) if self.excitation == "none" else self

    def check(self) -> None:
        """Raise ``InvalidValueError`` for a vehicle without wheels and for speeds in no order."""
        if self.r_w is None:
            raise InvalidValueError(
                f"a sample of kind '{self.kind}' needs a vehicle with wheels: give the vehicle file their radius r_w"
            )
        if self.slowest > self.fastest:
            raise InvalidValueError(
                f"'sample.slowest' {self.slowest:g} m/s must not be above 'sample.fastest' {self.fastest:g} m/s"
            )

    def sampled(self, progress: Progress) -> Drawn:
        """States on wheels that nearly roll, and inputs."""
        assert self.r_w is not None, "checked"
        largest, magnitudes = (self.v_y, self.yaw_rate, self.slip), (self.torque, self.steer, self.steer_rear)
        speeds = (self.slowest, self.fastest)
        return Drawn(
            *sampling.drive(self.seed, self.count, speeds, largest, self.r_w, self.excitation, magnitudes, self.steps)
        )


@dataclass(frozen=True, kw_only=True)
class DriveSample(Driven):
    """Cars under way on wheels, with torques and steer, to train."""

    kind: ClassVar[str] = "drive"


@dataclass(frozen=True, kw_only=True)
class DriveTestSample(Driven):
    """The same of another seed, to test."""

    kind: ClassVar[str] = "drive-test"
    tests = True
    seed: int = setting(7, low=0, high=SEED_LIMIT, option=True, help="seed of every draw")
