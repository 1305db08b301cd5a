"""Ghosts drive where their states lead them, and say how far they are off."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from koopcli.errors import InvalidValueError
from koopcli.reproduction import ghosts
from koopcli.reproduction.road import HALF_WIDTH, OVERHANG, off_text, road
from koopcli.simulation.integrate import simulate
from koopcli.vehicles.plants.forces import ForceInput

BOX = (30.0, 30.0, 10.0)


def driven(plant, box=BOX):
    x0, u = ghosts.swerve(plant, box, 0.01)
    return simulate(plant.rhs, x0[np.newaxis], u[np.newaxis], 0.01)[0], u


@pytest.mark.parametrize("wheels", [1, 2])
def test_the_swerve_changes_the_lane_and_keeps_speed_and_heading(lopsided, wheels):
    """The forces are those of the equations of motion: the yaw rate is its sine, the car does not slide."""
    x, _ = driven(replace(lopsided, wheels_per_force=wheels))
    end = ghosts.path(x, 0.01)[-1]
    assert x[:, 0] == pytest.approx(np.full(len(x), ghosts.SPEED), rel=0.01)
    assert np.abs(x[:, 1]).max() < 0.1
    assert x[-1, 2] == pytest.approx(0.0, abs=1e-6)
    assert end[2] == pytest.approx(0.0, abs=1e-3)
    offset = ghosts.SIDEWAYS * ghosts.SECONDS**2 / (2 * np.pi)
    assert end[1] == pytest.approx(offset, rel=0.02)


def test_the_swerve_stays_inside_the_training_box(plant):
    small = (10.0, 5.0, 0.3)
    for box in (BOX, small):
        x, u = driven(plant, box)
        assert (np.abs(x) <= box).all()
        assert np.abs(u).max() < 1e4  # as far as test inputs go


def test_a_circle_closes():
    """At a constant speed and yaw rate the path is a circle of radius v / r; 2nd order of the trapezoidal rule."""
    gaps = []
    for steps in (100, 200):
        dt = 2 * np.pi / 0.5 / steps
        path = ghosts.path(np.tile([10.0, 0.0, 0.5], (steps + 1, 1)), dt)
        gaps.append(abs(np.ptp(path[:, 1]) - 40.0))
    assert gaps[0] < 0.05
    assert gaps[0] / gaps[1] == pytest.approx(4.0, rel=0.05)


def test_a_prediction_that_is_lost_ends_and_says_when(plant):
    x, _ = driven(plant)
    wild = x.copy()
    wild[50:, 0] = np.inf
    still, lost = ghosts.tracks(x, {"same": x, "wild": wild}, 0.01)[1:]
    assert still.off.max() == 0
    assert off_text(still, 0.01) == "0 m off"
    assert np.isfinite(lost.path[:50]).all()
    assert np.isnan(lost.path[50:]).all()
    assert off_text(lost, 0.01) == "more than 20 m off after 0.50 s"
    shown = ghosts.Shown(tuple(ghosts.tracks(x, {"<wild>": wild}, 0.01)), 0.01, "a swerve", plant.parameters)
    html = "".join(road(shown))
    assert "<wild>" not in html
    assert "nan" not in html.lower()
    data = json.loads(re.search(r"<script[^>]*>(.*?)</script>", html)[1])
    assert [len(car) for car in data["cars"]] == [3 * len(x)] * 2
    assert data["off"][1][-1] is None


def test_a_car_that_spins_stays_inside_the_drawing(plant):
    x = np.tile([10.0, 0.0, 3.0], (60, 1))  # half a turn on a circle
    shown = ghosts.Shown(tuple(ghosts.tracks(x, {"same": x}, 0.01)), 0.01, "a spin", plant.parameters)
    left, top, width, height = map(float, re.search(r'viewBox="([^"]*)"', "".join(road(shown)))[1].split())
    for east, north, heading in shown.tracks[0].path:
        for along in (plant.parameters.l_f + OVERHANG, -plant.parameters.l_r - OVERHANG):
            for across in (HALF_WIDTH, -HALF_WIDTH):
                corner = east + along * np.cos(heading) - across * np.sin(heading)
                assert left < corner < left + width
                corner = north + along * np.sin(heading) + across * np.cos(heading)
                assert top < -corner < top + height


def test_the_true_car_drives_along_its_first_velocity(plant):
    x, _ = driven(plant)
    sideways = x.copy()
    sideways[0, :2] = 5.0, 5.0
    (true,) = ghosts.tracks(sideways, {}, 0.01)
    assert true.path[0, 2] == pytest.approx(-np.pi / 4)


def test_a_state_of_mean_error_that_drives_forwards():
    x0 = np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [1.0, 0.5, 0.0], [1.0, 0.0, 0.0]])
    assert ghosts.typical(np.array([1.0, 2.0, 2.5, np.nan]), x0) == 2  # the mean is 1.83, of one that backs up
    with pytest.raises(InvalidValueError, match="diverged"):
        ghosts.typical(np.full(4, np.nan), x0)


def test_a_plant_of_any_vehicle(vehicle):
    heavy = replace(vehicle, m=20 * vehicle.m, Jzz=20 * vehicle.Jzz)
    light, lorry = (driven(ForceInput(one))[0] for one in (replace(vehicle, c_w=0.0), replace(heavy, c_w=0.0)))
    assert lorry == pytest.approx(light, abs=1e-9)
