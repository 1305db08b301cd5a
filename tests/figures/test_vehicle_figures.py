"""The figures of the vehicle: what is drawn, not how it looks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from koopcli.config.pictures import Cone
from koopcli.figures import single_track, trajectory, tyre
from koopcli.figures.kit.figure import Source
from koopcli.records import Trajectories
from koopcli.simulation.manoeuvres import MANOEUVRES, OFFSET
from koopcli.vehicles.handling import wheel_loads
from koopcli.vehicles.plants.slips import SlipInput
from koopcli.vehicles.plants.wheels import TorqueInput
from tests.stages.toys import CAR, figure_settings


def test_tyre_curves_are_the_forces_of_the_plant():
    """A car that slides sideways feels two wheels an axle at the slip angle of its velocity."""
    settings = figure_settings("tyre")
    plant = SlipInput(replace(CAR, c_w=0.0))
    front, rear = wheel_loads(CAR)
    told = replace(settings.tyres[0], label="car", loads=(front, rear), mu_scale=CAR.mu_scale)
    curves = {curve.label: curve for curve in tyre.select([], replace(settings, tyres=(told,)))}
    assert set(curves) == {"car, front", "car, rear"}
    angle = curves["car, front"].slip_angle
    x = np.stack([20 * np.cos(angle), -20 * np.sin(angle), 0 * angle], axis=-1)
    sideways = CAR.m * plant.rhs(x, np.zeros((len(angle), 4)))[:, 1]
    assert sideways == pytest.approx(2 * (curves["car, front"].lateral + curves["car, rear"].lateral))


def test_equal_loads_are_one_curve_and_both_panels_have_it():
    settings = figure_settings("tyre")
    curves = tyre.select([], settings)
    assert [curve.label for curve in curves] == ["even", "nose-heavy, front", "nose-heavy, rear"]
    side, along = tyre.draw(curves).axes
    drawn = [line for line in side.lines if line.get_label() in {curve.label for curve in curves}]
    assert [line.get_ydata()[-1] for line in drawn] == [curve.lateral[-1] / 1e3 for curve in curves]
    assert side.get_xlabel() == "slip angle (°)"
    assert "kN" in side.get_ylabel()
    assert along.get_xlabel() == "slip ratio (1)"


def test_the_sketch_keeps_the_signs():
    arrows = {arrow.name: arrow for arrow in single_track.select([], figure_settings("single-track"))}
    assert set(arrows) >= {"$v_x$", "$v_y$", "$v$", "$F_{f,x}$", "$F_{f,y}$", "$F_{r,x}$", "$F_{r,y}$"}
    v = {name: arrow.head - arrow.tail for name, arrow in arrows.items()}
    assert v["$v_x$"] + v["$v_y$"] == pytest.approx(v["$v$"])
    for axle in "fr":
        along, side, velocity = v[f"$F_{{{axle},x}}$"], v[f"$F_{{{axle},y}}$"], v[f"$v_{axle}$"]
        assert along @ side == pytest.approx(0)
        assert side @ velocity < 0  # a lateral force works against the sliding
    turning = v["$v_f$"][1] - v["$v_r$"][1]
    assert turning > 0  # a positive yaw rate turns the front to the left
    figure = single_track.draw(list(arrows.values()))
    texts = {text.get_text() for text in figure.axes[0].texts}
    assert {r"$\delta_f$", r"$\delta_r$", r"$\alpha_f$", r"$\alpha_r$", "$l_f$", "$l_r$", "yaw rate"} <= texts


def lane_change(left=3.5, length=60.0, steps=120, torque=5.0):
    """A course that moves to the ``left`` by one sine of the heading over ``length``, at 20 m/s."""
    t = np.linspace(0, length / 20, steps + 1)
    heading = np.pi * left / (2 * length) * np.sin(np.pi * t / t[-1])
    x = np.zeros((1, steps + 1, 5))
    x[0, :, 0], x[0, :, 2] = 20.0, np.gradient(heading, t)
    x[0, :, 3:] = 20 / 0.3
    u = np.zeros((1, steps, 6))
    u[0, :, 0], u[0, :, 1] = np.sin(t[:-1]), torque
    plant = {"vehicle": {"r_w": 0.3}}
    return Trajectories(x, u, t[1], TorqueInput.states, TorqueInput.inputs, plant=plant)


def course_of(data, cones=()):
    settings = replace(figure_settings("trajectory"), trajectory=0, cones=cones)
    shown = trajectory.select([Source("", None, {"trajectories": data})], settings)
    return shown, trajectory.draw(shown)


def test_a_flat_course_is_stretched_and_another_is_not():
    """At 4 : 1 a lane is seen, and a car still points along its course."""
    _, figure = course_of(lane_change())
    course = figure.axes[0]
    assert course.get_aspect() == 4
    assert course.get_ylabel() == "Y, 4 : 1\n(m)"
    low, high = course.get_ylim()
    assert high - low < 4 * 3.5
    X, Y = course.lines[0].get_xydata().T
    middle = len(X) // 2
    cars = [line for line in course.lines if isinstance(line.get_marker(), tuple)]
    car = min(cars, key=lambda line: abs(line.get_xdata()[0] - X[middle]))
    at = int(np.abs(X - car.get_xdata()[0]).argmin())
    along = np.rad2deg(np.arctan2(4 * (Y[at + 1] - Y[at - 1]), X[at + 1] - X[at - 1]))
    assert car.get_marker()[2] + 90 == pytest.approx(along, abs=1)
    _, round_ = course_of(lane_change(left=40.0))
    assert (round_.axes[0].get_aspect(), round_.axes[0].get_ylabel()) == (1, "Y (m)")


def test_what_never_changes_has_no_panel_but_is_said():
    _, figure = course_of(lane_change())
    labels = [axes.get_ylabel() for axes in figure.axes]
    assert labels[1:] == ["yaw rate\n(rad/s)", "$a_{y}$\n(m/s²)", "steer f\n(rad)"]
    assert figure.axes[0].get_title() == "constant: car, front rim, rear rim 20 m/s; drive f 5 N m"
    data = lane_change()
    data.u[..., 2:] = [6.0, 0.0, 7.0, 8.0]
    title = course_of(data)[1].axes[0].get_title().replace("\n", " ")
    assert title.endswith("drive f 5 N m; brake f 6 N m; drive r 7 N m; brake r 8 N m")  # in the order of the inputs

    _, coasting = course_of(lane_change(torque=0.0))
    assert "drive" not in coasting.axes[0].get_title()


def test_cones_stand_where_the_lanes_of_the_manoeuvre_begin_and_end():
    """Lengths of the double lane change: 15, 30, 25, 25, 15 m; every lane is wider than a car, the next wider still."""
    cones = MANOEUVRES["double-lane-change"].cones
    assert sorted({X for X, _ in cones}) == [0, 15, 45, 70, 95, 110]
    gates = [(X, [Y for ahead, Y in cones if ahead == X]) for X in (0, 45, 95)]
    assert [np.mean(sides) for _, sides in gates] == pytest.approx([0, OFFSET, 0])
    widths = [np.ptp(sides) for _, sides in gates]
    assert 1.8 < widths[0] < widths[1] < widths[2] < OFFSET
    assert all(not other.cones for name, other in MANOEUVRES.items() if name != "double-lane-change")
    shown, figure = course_of(lane_change(), tuple(Cone(*at) for at in cones))
    drawn = figure.axes[0].lines[-1].get_xydata()
    assert drawn.tolist() == [list(at) for at in cones]
    assert trajectory.numbers(shown)["cone Y"].values.tolist() == [Y for _, Y in cones]
