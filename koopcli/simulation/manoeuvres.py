"""Manoeuvres that test drivers know, as steer and torques over time: open loop, for any vehicle on wheels.

Steer is scaled to what the linear single-track car needs for the lateral acceleration that a source asks for (9.2), so
cars near their limits leave the course; nobody corrects them. Torques are those of one wheel.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from koopcli.vehicles.handling import G, steady_steer, tyres_of, wheel_loads
from koopcli.vehicles.parameters import VehicleParameters

ManoeuvreName = Literal["step-steer", "double-lane-change", "sine-with-dwell", "brake-in-turn", "drift-entry"]

KMH = 1 / 3.6  # m/s


@dataclass(frozen=True)
class Driver:
    """Who drives ``vehicle`` at ``speed`` m/s, with all that is done multiplied by ``scale``."""

    vehicle: VehicleParameters
    speed: float
    scale: float = 1.0

    def steer(self, lateral: float) -> float:
        """Steer in rad for a steady turn at ``lateral`` m/s²."""
        return self.scale * steady_steer(self.vehicle, self.speed, lateral)

    def brake(self, deceleration: float) -> tuple[float, float]:
        """Brake torque in N m of a front and of a rear wheel for ``deceleration`` m/s², shared by static load."""
        front, rear = (abs(self.scale) * self._radius * load * deceleration / G for load in wheel_loads(self.vehicle))
        return front, rear

    def spin(self, share: float) -> float:
        """Drive torque in N m of a rear wheel that asks for ``share`` of its grip."""
        grip = self.vehicle.mu_scale * tyres_of(self.vehicle, "longitudinal")[1].mu * wheel_loads(self.vehicle)[1]
        return abs(self.scale) * share * self._radius * grip

    @property
    def cruise(self) -> float:
        """Drive torque in N m of each of four wheels that air drag takes at this speed."""
        p = self.vehicle
        return self._radius * 0.5 * p.c_w * p.rho * p.A * self.speed**2 / 4

    @property
    def _radius(self) -> float:
        assert self.vehicle.r_w is not None, "checked by the plant"
        return self.vehicle.r_w


@dataclass(frozen=True)
class Controls:
    """Steer in rad of the front wheels, and torques in N m of a front and of a rear wheel."""

    steer: float = 0.0
    drive: tuple[float, float] = (0.0, 0.0)
    brake: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True)
class Manoeuvre:
    """What it is ``about`` in a line, its ``source``, its first ``speed`` in m/s and length in ``seconds``, and the
    ``controls`` of the driver at a time in s; ``cones``: where they stand, ahead and to the left of the start in m.
    """

    about: str
    source: str
    speed: float
    seconds: float
    controls: Callable[[Driver, float], Controls]
    cones: tuple[tuple[float, float], ...] = ()

    def inputs(self, driver: Driver, times: list[float]) -> list[list[float]]:
        """Inputs of the plant on wheels at each of ``times`` in s: steer, drive and brake in front, then behind."""
        rows = []
        for t in times:
            c = self.controls(driver, t)
            rows.append([c.steer, c.drive[0], c.brake[0], 0.0, c.drive[1], c.brake[1]])
        return rows


def _ramp(t: float, start: float, length: float) -> float:
    """From 0 to 1 between ``start`` and ``start + length``."""
    return min(1.0, max(0.0, (t - start) / length))


def _pulse(t: float, start: float, length: float) -> float:
    """One period of a sine that starts at ``start``."""
    return math.sin(2 * math.pi * (t - start) / length) if start <= t < start + length else 0.0


def _step_steer(driver: Driver, t: float) -> Controls:
    return Controls(driver.steer(4.0) * _ramp(t, 0.5, 0.15), (driver.cruise, driver.cruise))


OFFSET = 3.5  # m from lane to lane
CHANGES = ((15.0, 30.0, 1), (70.0, 25.0, -1))  # each begins at, takes (m), and goes to the left or back


def _double_lane_change(driver: Driver, t: float) -> Controls:
    """A lane change of d m in T s is one sine of lateral acceleration of amplitude 2π d / T²."""
    steer = 0.0
    for begin, length, side in CHANGES:
        seconds = length / driver.speed
        steer += side * driver.steer(2 * math.pi * OFFSET / seconds**2) * _pulse(t, begin / driver.speed, seconds)
    return Controls(steer, (driver.cruise, driver.cruise))


WIDTH = 1.8  # m, of a passenger car: no vehicle file has it
LANES = (  # each ahead from and to, to the left by (m), and its width in widths of the car, with 0.25 m to spare
    (0.0, CHANGES[0][0], 0.0, 1.1),
    (CHANGES[0][0] + CHANGES[0][1], CHANGES[1][0], OFFSET, 1.2),
    (CHANGES[1][0] + CHANGES[1][1], CHANGES[1][0] + CHANGES[1][1] + 15.0, 0.0, 1.3),
)


def _gates() -> tuple[tuple[float, float], ...]:
    """Cones at both ends of every lane, on both sides of its middle."""
    return tuple(
        (ahead, left + side * (widths * WIDTH + 0.25) / 2)
        for start, end, left, widths in LANES
        for ahead in (start, end)
        for side in (1, -1)
    )


SINE, DWELL = 0.7, 0.5  # Hz; s at the second peak
LARGEST_FACTOR = 6.5  # of the steer for .3 g, the last run of the series


def _sine_with_dwell(driver: Driver, t: float) -> Controls:
    since, peak = t - 0.5, 0.75 / SINE
    phase = since if since < peak else max(peak, since - DWELL)
    shape = math.sin(2 * math.pi * SINE * phase) if 0 <= phase < 1 / SINE else 0.0
    return Controls(LARGEST_FACTOR * driver.steer(0.3 * G) * shape)


def _brake_in_turn(driver: Driver, t: float) -> Controls:
    on = _ramp(t, 3.0, 0.2)
    front, rear = driver.brake(5.0)
    cruise = driver.cruise * (1 - on)
    return Controls(driver.steer(5.0) * _ramp(t, 0.2, 1.0), (cruise, cruise), (on * front, on * rear))


def _drift_entry(driver: Driver, t: float) -> Controls:
    p = driver.vehicle
    turn = driver.steer(0.5 * p.mu_scale * tyres_of(p, "lateral")[0].mu * G)
    counter = 1 - 1.5 * _ramp(t, 1.9, 0.3)
    spin = driver.spin(1.1 if t < 1.7 else 0.45)
    return Controls(turn * _ramp(t, 0.2, 0.5) * counter, (0.0, driver.cruise if t < 1.5 else spin))


MANOEUVRES: dict[ManoeuvreName, Manoeuvre] = {
    "step-steer": Manoeuvre(
        "steer turned within .15 s to what holds 4 m/s² of lateral acceleration",
        "ISO 7401:2011, step input, 80 km/h",
        80 * KMH,
        4.0,
        _step_steer,
    ),
    "double-lane-change": Manoeuvre(
        "one lane to the left within 30 m and back within 25 m, 25 m apart",
        "lengths of ISO 3888-1:2018, which has a driver and 80 km/h; here open loop at 50 km/h",
        50 * KMH,
        9.0,
        _double_lane_change,
        _gates(),
    ),
    "sine-with-dwell": Manoeuvre(
        "one sine of steer at .7 Hz, held for half a second at its second peak, coasting",
        "FMVSS 126 (49 CFR 571.126), the last run of the series: 6.5 times the steer for .3 g, 80 km/h",
        80 * KMH,
        4.0,
        _sine_with_dwell,
    ),
    "brake-in-turn": Manoeuvre(
        "a steady turn of 100 m radius at 5 m/s², then braked with 5 m/s² to a standstill, the steer held",
        "ISO 7975:2019",
        math.sqrt(5.0 * 100.0),
        9.0,
        _brake_in_turn,
    ),
    "drift-entry": Manoeuvre(
        "a turn at half the grip, rear wheels spun up by 1.1 times theirs for .2 s, then steered against",
        "power-over entry as described by Velenis et al., Control Engineering Practice 19 (2011); no standard",
        12.0,
        4.0,
        _drift_entry,
    ),
}
