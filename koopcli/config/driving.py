"""The settings of samples that are driven: by torques and steer at random, or through a manoeuvre."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, Self

from koopcli.checks import setting
from koopcli.config.sampled import LARGEST, SEED_LIMIT, Excitation, Sampled
from koopcli.simulation.manoeuvres import MANOEUVRES
from koopcli.vehicles.parameters import VehicleParameters

ManoeuvreName = Literal["step-steer", "double-lane-change", "sine-with-dwell", "brake-in-turn", "drift-entry"]

N_X, N_U = 5, 6  # states and inputs of the plant on wheels
MAGNITUDES = ("torque", "steer", "steer_rear")  # of inputs


@dataclass(frozen=True, kw_only=True)
class Driven(Sampled):
    """States of a car under way on wheels that nearly roll, with torques and steer drawn for each trajectory."""

    seed: int = setting(0, low=0, high=SEED_LIMIT, help="seed of every draw")
    count: int = setting(3375, low=1, high=100_000_000, help="number of states")
    slowest: float = setting(5.0, low=-LARGEST, high=LARGEST, unit="m/s", help="v_x at least; in reverse below zero")
    fastest: float = setting(30.0, low=-LARGEST, high=LARGEST, unit="m/s", help="v_x at most")
    v_y: float = setting(1.0, low=0, high=LARGEST, unit="m/s", help="|v_y| at most")
    yaw_rate: float = setting(0.3, low=0, high=LARGEST, unit="rad/s", help="|yaw rate| at most")
    slip: float = setting(
        0.02, low=0, high=1, unit="1", help="share of v_x that wheels turn faster or slower by, at most"
    )
    excitation: Excitation = setting("held", help="inputs: none, fresh at each step, or held")
    torque: float = setting(300.0, low=0, high=LARGEST, unit="N m", help="drive or brake torque of a wheel at most")
    steer: float = setting(0.05, low=0, high=1.5, unit="rad", help="front steer at most, to either side")
    steer_rear: float = setting(0.01, low=0, high=1.5, unit="rad", help="rear steer at most, to either side")
    steps: int = setting(100, low=1, high=1_000_000, help="steps of each trajectory")
    r_w: float | None

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
        return self.count * (N_X + N_U * (self.input_steps or 1))

    def settled(self) -> Self:
        """The same sample: magnitudes without inputs are reset to zero."""
        return replace(self, torque=0.0, steer=0.0, steer_rear=0.0) if self.excitation == "none" else self


@dataclass(frozen=True, kw_only=True)
class DriveSample(Driven):
    """The training set on wheels."""

    kind: Literal["drive"] = "drive"


@dataclass(frozen=True, kw_only=True)
class DriveTestSample(Driven):
    """Its test set, of another seed."""

    kind: Literal["drive-test"] = "drive-test"
    seed: int = setting(7, low=0, high=SEED_LIMIT, help="seed of every draw")


@dataclass(frozen=True, kw_only=True)
class ManoeuvreSample(Sampled):
    """One car through a manoeuvre that test drivers know, with steer and torques that suit the vehicle."""

    kind: Literal["manoeuvre"] = "manoeuvre"
    name: ManoeuvreName = setting("double-lane-change", help="which one")
    speed: float | None = setting(None, above=0, high=200, unit="m/s", help="first v_x; else as its source has it")
    scale: float = setting(1.0, low=-100, high=100, unit="1", help="factor on steer and torques; below 0 to the right")
    vehicle: VehicleParameters
    dt: float

    @property
    def trajectories(self) -> int:
        """How many trajectories start from the sample."""
        return 1

    @property
    def horizon(self) -> int:
        """Steps of the trajectory unless told otherwise."""
        return max(1, round(MANOEUVRES[self.name].seconds / self.dt))

    @property
    def input_steps(self) -> int | None:
        """Steps that the sample holds inputs for."""
        return self.horizon

    @property
    def driven(self) -> bool:
        """Whether inputs change within its trajectory."""
        return self.scale != 0

    @property
    def numbers(self) -> int:
        """How many numbers the sample stores."""
        return N_X + N_U * self.horizon

    def settled(self) -> ManoeuvreSample:
        """The same sample: its speed is written out."""
        return replace(self, speed=self.speed or MANOEUVRES[self.name].speed)
