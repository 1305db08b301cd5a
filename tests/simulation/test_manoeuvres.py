"""Manoeuvres do what their names say, in the plant on wheels."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from koopcli.config.shipped import vehicle_named
from koopcli.simulation import sampling
from koopcli.simulation.integrate import simulate
from koopcli.simulation.manoeuvres import MANOEUVRES, Driver
from koopcli.vehicles.plants.wheels import TorqueInput


@cache
def both_ways(name, vehicle="bmw-320i"):
    """States (2, samples, 5) and inputs (2, steps, 6) of a manoeuvre and its mirror image, driven once."""
    plant, manoeuvre = TorqueInput(vehicle_named(vehicle)), MANOEUVRES[name]
    times = [0.01 * k for k in range(round(manoeuvre.seconds / 0.01))]
    u = np.array([manoeuvre.inputs(Driver(plant.parameters, manoeuvre.speed, scale), times) for scale in (1.0, -1.0)])
    rate = manoeuvre.speed / plant.parameters.r_w
    x0 = np.tile([manoeuvre.speed, 0, 0, rate, rate], (2, 1))
    return simulate(plant.rhs, x0, u, 0.01, fastest_rate=plant.fastest_rate), u


def drive(name, vehicle="bmw-320i"):
    """States (samples, 5), inputs (steps, 6) and place (samples, 2)."""
    (x, _), (u, _) = both_ways(name, vehicle)
    heading = np.cumsum(x[:, 2]) * 0.01
    east = np.cos(heading) * x[:, 0] - np.sin(heading) * x[:, 1]
    north = np.sin(heading) * x[:, 0] + np.cos(heading) * x[:, 1]
    return x, u, 0.01 * np.cumsum(np.stack([east, north], axis=1), axis=0)


def lateral(x):
    return np.gradient(x[:, 1], 0.01) + x[:, 2] * x[:, 0]


@pytest.mark.slow
@pytest.mark.parametrize("name", MANOEUVRES)
def test_every_manoeuvre_has_a_source_and_a_mirror_image(name):
    assert MANOEUVRES[name].source
    assert MANOEUVRES[name].about
    (x, mirrored), u = both_ways(name)
    assert np.isfinite(x).all()
    if name != "drift-entry":  # which multiplies what rounding leaves
        assert mirrored == pytest.approx(x * [1, -1, -1, 1, 1], rel=1e-6, abs=1e-6)
    assert (u[..., [2, 5]] >= 0).all()


@pytest.mark.slow
def test_step_steer_holds_its_lateral_acceleration():
    x, u, _ = drive("step-steer")
    (_, mirrored), _ = both_ways("step-steer")
    assert mirrored == pytest.approx(x * [1, -1, -1, 1, 1], rel=1e-6, abs=1e-6)
    assert lateral(x)[-1] == pytest.approx(4.0, rel=0.06)  # linear, of a tyre that is not
    assert np.ptp(x[:, 0]) < 0.3  # its drive torque makes up for drag
    moved = np.flatnonzero((u[:, 0] > 0.01 * u[-1, 0]) & (u[:, 0] < 0.99 * u[-1, 0]))
    assert len(moved) <= 15


@pytest.mark.slow
def test_the_double_lane_change_comes_to_the_next_lane_and_back():
    _, _, place = drive("double-lane-change")
    between = (place[:, 0] > 50) & (place[:, 0] < 65)
    assert place[between, 1] == pytest.approx(np.full(between.sum(), 3.5), abs=0.3)
    assert abs(place[-1, 1]) < 0.5
    assert place[place[:, 0] < 15, 1] == pytest.approx(0, abs=1e-6)


@pytest.mark.slow
def test_sine_with_dwell_is_the_standards():
    x, u, _ = drive("sine-with-dwell")
    (_, mirrored), _ = both_ways("sine-with-dwell")
    assert mirrored == pytest.approx(x * [1, -1, -1, 1, 1], rel=1e-6, abs=1e-6)
    steer, car = u[:, 0], vehicle_named("bmw-320i")
    peak = 6.5 * (car.l_f + car.l_r) * 0.3 * 9.81 / (80 / 3.6) ** 2
    assert steer.max() == pytest.approx(peak, rel=1e-3)
    assert steer.min() == pytest.approx(-peak, rel=1e-3)
    assert (steer < -0.999 * peak).sum() == pytest.approx(50 + 2, abs=2)  # half a second
    assert np.flatnonzero(steer)[-1] == pytest.approx(50 + 100 / 0.7 + 50, abs=2)
    assert not u[:, [1, 2, 4, 5]].any()  # it coasts


@pytest.mark.slow
def test_brake_in_turn_brakes_to_a_standstill():
    x, u, _ = drive("brake-in-turn")
    assert lateral(x)[290] == pytest.approx(5.0, rel=0.08)
    slowing = -np.diff(x[:, 0])[350:600].mean() / 0.01
    assert slowing == pytest.approx(5.0, rel=0.1)
    assert np.abs(x[-1]).max() < 0.05
    assert u[-1, 0] == u[200, 0]


@pytest.mark.slow
def test_drift_entry_breaks_the_rear_away():
    x, _, _ = drive("drift-entry", "ctu-2020")
    sliding = np.abs(np.rad2deg(np.arctan2(x[:, 1], x[:, 0])))
    assert sliding[:140].max() < 5
    assert sliding.max() > 10
    assert x[:, 4].max() > 1.5 * x[:, 3].max()


def test_drives_start_on_wheels_that_nearly_roll():
    x, u = sampling.drive(3, 500, (5.0, 30.0), (1.0, 0.3, 0.02), 0.33, "held", (300.0, 0.05, 0.01), 100)
    assert (x[:, 0].min() >= 5, x[:, 0].max() <= 30) == (True, True)
    assert np.abs(0.33 * x[:, 3:] / x[:, :1] - 1).max() <= 0.02
    assert u.shape == (500, 1, 6)
    assert not (u[..., 1::3] * u[..., 2::3]).any()  # a wheel is driven or braked
    assert (u[..., 2::3] >= 0).all()
    assert [np.abs(u[..., i]).max() <= bound for i, bound in enumerate((0.05, 300, 300, 0.01, 300, 300))] == [True] * 6
    again, fresh = sampling.drive(3, 500, (5.0, 30.0), (1.0, 0.3, 0.02), 0.33, "fresh", (300.0, 0.05, 0.01), 4)
    assert (again == x).all()
    assert fresh.shape == (500, 4, 6)
