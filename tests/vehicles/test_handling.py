"""Numbers that follow from the parameters, against the equations of motion themselves."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from koopcli.checks import COMMAND_LINE
from koopcli.config.shipped import vehicle_named
from koopcli.errors import InvalidValueError
from koopcli.simulation.portrait import derived, plants_of, remarks
from koopcli.vehicles import handling
from koopcli.vehicles.parameters import MagicFormula, change
from koopcli.vehicles.plants.slips import SlipInput


def jacobian(car, speed):
    """Of v_y and yaw rate in straight running."""
    plant, x, u = SlipInput(replace(car, c_w=0.0)), np.array([speed, 0, 0]), np.zeros(4)
    return np.stack([(plant.rhs(x + d, u) - plant.rhs(x - d, u))[1:] / 2e-6 for d in 1e-6 * np.eye(3)[1:]], axis=1)


@pytest.fixture
def nervous(vehicle):
    """Soft tyres behind: the car oversteers."""
    return replace(vehicle, lateral_rear=replace(vehicle.lateral, B=5.0))


def test_loads_carry_the_car():
    car = vehicle_named("bmw-320i")
    front, rear = handling.wheel_loads(car)
    assert 2 * (front + rear) == pytest.approx(car.m * 9.81)
    assert front * car.l_f == pytest.approx(rear * car.l_r)  # no pitching moment


@pytest.mark.parametrize("name", ["ctu-2020", "rimac-2018", "efremov-2020", "bmw-320i"])
def test_cars_with_one_kind_of_tyre_are_neutral(name):
    """Forces follow loads, so both axles saturate alike: the steer of a turn is L / R at any speed."""
    car = vehicle_named(name)
    assert handling.understeer_gradient(car) == 0.0
    assert handling.critical_speed(car) == math.inf
    assert handling.steady_steer(car, 20.0, 3.0) == pytest.approx((car.l_f + car.l_r) * 3.0 / 400)


def test_the_stiffness_is_the_slope_of_the_axle(nervous):
    for car in (nervous, replace(nervous, lateral_rear=replace(nervous.lateral, S_h=0.03))):
        front, rear = handling.cornering_stiffness(car)
        J = jacobian(car, 20.0)
        assert J[0, 0] == pytest.approx(-(front + rear) / (car.m * 20), rel=1e-5)
        assert J[1, 0] == pytest.approx((car.l_r * rear - car.l_f * front) / (car.Jzz * 20), rel=1e-4, abs=1e-6)


def test_beyond_the_critical_speed_straight_running_is_unstable(nervous):
    critical = handling.critical_speed(nervous)
    assert 10 < critical < 100
    below, above = (np.linalg.eigvals(jacobian(nervous, share * critical)).real.max() for share in (0.98, 1.02))
    assert below < 0 < above
    assert any("oversteers" in remark for remark in remarks(nervous))


def test_a_car_that_understeers_takes_more_steer(vehicle):
    car = replace(vehicle, lateral_rear=replace(vehicle.lateral, B=12.0))
    assert handling.understeer_gradient(car) > 0
    assert handling.steady_steer(car, 20.0, 3.0) > handling.steady_steer(vehicle, 20.0, 3.0)


def test_wheel_poles_of_the_published_vehicle():
    """8 700 1/s at 1 m/s, by hand: r² B C D / J_R."""
    car = vehicle_named("efremov-2020")
    D = 1.0 * 1200 * 9.81 * 1.6 / 6.0
    assert handling.wheel_poles(car, 1.0, 0.5)[0] == pytest.approx(0.33**2 * 15 * 1.7 * D / 1.0)
    assert handling.wheel_poles(car, 1.0, 0.5)[0] == pytest.approx(8700, rel=5e-3)
    assert handling.wheel_poles(car, 0.0, 0.5) == handling.wheel_poles(car, 0.5, 0.5)


def test_derived_numbers_follow_what_is_known(vehicle):
    everything = {one.name: one for one in derived(vehicle, 0.01)}
    assert everything["wheelbase"].value == 2.745
    assert everything["substeps at 1 m/s"].value >= everything["wheel pole at 1 m/s"].value * 0.01 / 2.78
    assert everything["substeps at 30 m/s"].value < everything["substeps at 1 m/s"].value
    bare = replace(vehicle, lateral=None, longitudinal=None)
    assert [one.name for one in derived(bare, 0.01)] == ["wheelbase", "load of a front wheel", "load of a rear wheel"]
    assert set(plants_of(vehicle)) >= {"forces", "slips", "wheels"}
    assert "forces" in plants_of(bare)
    assert not {"slips", "wheels"} & set(plants_of(bare))
    assert "wheels" not in plants_of(replace(vehicle, J_R=None))
    assert len(derived(replace(vehicle, J_R=None), 0.01)) == 7


def test_what_looks_odd_is_said(vehicle):
    assert [text.partition(" is ")[0] for text in remarks(vehicle)] == ["peak grip"]  # doubled by its authors
    in_millimetres = change(vehicle, {"l_f": 1372.5, "l_r": 1372.5}, COMMAND_LINE)
    assert any("wheelbase is 2745 m" in text and "unit" in text for text in remarks(in_millimetres))
    assert any("no tyres" in text for text in remarks(replace(vehicle, lateral=None, longitudinal=None)))


def test_tyres_that_cannot_be(vehicle):
    with pytest.raises(InvalidValueError, match=r"'longitudinal\.S_h' must be 0, got 0\.1: a shift along the wheel"):
        change(vehicle, {"longitudinal": {"S_h": 0.1}}, COMMAND_LINE)
    with pytest.raises(InvalidValueError, match="'lateral_rear' stands beside 'lateral', which is missing"):
        replace(vehicle, lateral=None, lateral_rear=MagicFormula(8.0, 1.3, 1.0, 0.0))
