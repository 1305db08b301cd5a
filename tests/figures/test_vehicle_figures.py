"""The figures of the vehicle: what is drawn, not how it looks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from koopcli.figures import single_track, tyre
from koopcli.vehicles.handling import wheel_loads
from koopcli.vehicles.single_track import SlipInput
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
