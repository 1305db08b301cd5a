"""One car through a manoeuvre that test drivers know."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from koopcli.choices import setting, taken_from
from koopcli.errors import InvalidValueError
from koopcli.progress import Progress
from koopcli.simulation.manoeuvres import MANOEUVRES, Driver, ManoeuvreName
from koopcli.simulation.samples.sample import Drawn, SampleChoice
from koopcli.vehicles.handling import understeer_gradient
from koopcli.vehicles.parameters import VehicleParameters
from koopcli.vehicles.plants.wheels import TorqueInput, Wheels


@dataclass(frozen=True, kw_only=True)
class ManoeuvreSample(SampleChoice):
    """One car through a manoeuvre that test drivers know, with steer and torques that suit the vehicle."""

    kind: ClassVar[str] = "manoeuvre"
    meant_for = Wheels
    tests = True
    name: ManoeuvreName = setting("double-lane-change", option=True, help="which one")
    speed: float | None = setting(
        None, above=0, high=200, unit="m/s", option=True, help="first v_x; else as its source has it"
    )
    scale: float = setting(
        1.0, low=-100, high=100, unit="1", option=True, help="factor on steer and torques; below 0 to the right"
    )
    vehicle: VehicleParameters = taken_from("simulate")
    dt: float = taken_from("simulate")

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
        return len(Wheels.states) + len(Wheels.inputs) * self.horizon

    def settled(self) -> ManoeuvreSample:
        """The same sample: its speed is written out."""
        return replace(self, speed=self.speed or MANOEUVRES[self.name].speed)

    def check(self) -> None:
        """Raise ``InvalidValueError`` for a vehicle without wheels, tyres or grip."""
        TorqueInput(self.vehicle)
        if not math.isfinite(understeer_gradient(self.vehicle)):
            raise InvalidValueError("no steer turns a car without grip: raise vehicle.mu_scale or lateral.mu above 0")

    def sampled(self, progress: Progress) -> Drawn:
        """The first state (1, 5), on wheels that roll, and the inputs (1, steps, 6)."""
        assert self.speed is not None, "settled"
        assert self.vehicle.r_w is not None, "checked"
        driver = Driver(self.vehicle, self.speed, self.scale)
        rate = self.speed / self.vehicle.r_w
        u = MANOEUVRES[self.name].inputs(driver, [k * self.dt for k in range(self.horizon)])
        return Drawn(np.array([[self.speed, 0.0, 0.0, rate, rate]]), np.array([u]))
