from __future__ import annotations

import json

import numpy as np
import pytest

from koopcli.errors import InvalidValueError
from koopcli.simulation.integrate import simulate
from koopcli.vehicles.plants import PLANTS, remembered_plant
from koopcli.vehicles.plants.forces import WHEELS_PER_FORCE, ForceInput, Forces
from koopcli.vehicles.plants.slips import SlipInput
from tests.conftest import ball_of, surface_of

MIRROR_X = np.array([1, -1, -1])  # v_y and yaw rate change sign
MIRROR_U = np.array([1, -1, 1, -1])  # lateral forces change sign


@pytest.fixture
def states() -> np.ndarray:
    return np.random.default_rng(1).uniform(-1, 1, (200, 3)) * [30, 30, 10]


@pytest.fixture
def inputs() -> np.ndarray:
    return np.random.default_rng(2).uniform(-1e4, 1e4, (200, 4))


def test_by_hand(plant):
    # v = (3, 4) m/s: |v| = 5, drag coefficient ½·0.18·1.22·2·5 = 1.098
    dx = plant.rhs(np.array([3.0, 4.0, 2.0]), np.array([100.0, 200.0, 300.0, 400.0]))
    assert dx == pytest.approx(
        [(400 - 1.098 * 3) / 1300 + 8, (600 - 1.098 * 4) / 1300 - 6, 1.3725 * (200 - 400) / 1400], rel=1e-14
    )


def test_the_axles_turn_the_car_by_their_own_levers(lopsided):
    p = lopsided.parameters
    front, rear = np.array([0.0, 1.0, 0.0, 0.0]), np.array([0.0, 0.0, 0.0, 1.0])
    assert lopsided.rhs(np.zeros(3), front)[2] == pytest.approx(p.l_f / p.Jzz)
    assert lopsided.rhs(np.zeros(3), rear)[2] == pytest.approx(-p.l_r / p.Jzz)


def test_mirror_symmetry(lopsided, states, inputs):
    mirrored = lopsided.rhs(states * MIRROR_X, inputs * MIRROR_U)
    assert mirrored == pytest.approx(lopsided.rhs(states, inputs) * MIRROR_X, rel=1e-15, abs=0)


def test_a_force_per_wheel_counts_twice(vehicle, states, inputs):
    per_axle, per_wheel = ForceInput(vehicle, 1), ForceInput(vehicle, 2)
    assert per_wheel.rhs(states, inputs) == pytest.approx(per_axle.rhs(states, 2 * inputs), rel=1e-15)


@pytest.mark.parametrize("sign", [1, -1])
def test_energy_never_grows_without_input(lopsided, states, sign):
    x = simulate(lopsided.rhs, sign * states, np.zeros((200, 100, 4)), 0.01)
    energy = lopsided.kinetic_energy(x)
    assert (np.diff(energy, axis=1) <= 1e-9 * energy[:, :1]).all()
    assert (energy[:, -1] < energy[:, 0]).all()


def test_energy_is_kept_without_drag(plant, vehicle, states):
    from dataclasses import replace

    gliding = ForceInput(replace(vehicle, c_w=0.0))
    energy = gliding.kinetic_energy(simulate(gliding.rhs, states, np.zeros((200, 100, 4)), 0.001))
    assert energy == pytest.approx(np.broadcast_to(energy[:, :1], energy.shape), rel=1e-9)


def test_the_power_of_the_forces_is_what_the_energy_gains(plant, vehicle, states, inputs):
    from dataclasses import replace

    gliding = ForceInput(replace(vehicle, c_w=0.0))
    p, dx = vehicle, gliding.rhs(states, inputs)
    gain = p.m * (states[:, :2] * dx[:, :2]).sum(1) + p.Jzz * states[:, 2] * dx[:, 2]
    v_x, v_y, r = states.T
    F_fx, F_fy, F_rx, F_ry = inputs.T
    power = F_fx * v_x + F_fy * (v_y + p.l_f * r) + F_rx * v_x + F_ry * (v_y - p.l_r * r)
    assert gain == pytest.approx(power, rel=1e-9, abs=1e-6)


@pytest.mark.parametrize("name", PLANTS)
def test_every_plant_keeps_the_contract(name, vehicle):
    for force_per in WHEELS_PER_FORCE:
        plant = Forces(force_per).of(vehicle)
        n_x, n_u = len(plant.states), len(plant.inputs)
        assert len(plant.states.units) == n_x
        x, u = np.ones((5, 2, n_x)), np.ones((5, 2, n_u))
        assert plant.rhs(x, u).shape == x.shape
        assert plant.rhs(np.zeros(n_x), np.zeros(n_u)) == pytest.approx(np.zeros(n_x))


def test_the_slip_plant_by_hand(sliding):
    """Every number written out in plain scalars, with steer and slip on both axles and a velocity in reverse."""
    from math import atan, atan2, cos, hypot, sin

    v_x, v_y, r = -4.0, 1.5, 0.8
    steer_f, kappa_f, steer_r, kappa_r = 0.2, 0.05, -0.1, -0.03
    load = 1300 * 9.81 / 4
    drag = 0.5 * 0.18 * 1.22 * 2.0 * hypot(v_x, v_y)
    sum_x, forces_y = -drag * v_x, []
    for arm, steer, kappa in ((1.3725, steer_f, kappa_f), (-1.3725, steer_r, kappa_r)):
        at_x, at_y = v_x, v_y + arm * r
        along, across = cos(steer) * at_x + sin(steer) * at_y, -sin(steer) * at_x + cos(steer) * at_y
        alpha = -atan2(across, abs(along))
        by, bx = 8.11 * alpha, 7.0 * kappa
        F_y = 1.95 * load * sin(1.3 * atan(by - 0.2 * (by - atan(by))))
        F_x = 2.15 * load * sin(1.6 * atan(bx + 0.5 * (bx - atan(bx))))
        sum_x += 2 * (cos(steer) * F_x - sin(steer) * F_y)
        forces_y.append(2 * (sin(steer) * F_x + cos(steer) * F_y))
    expected = [
        sum_x / 1300 + r * v_y,
        (sum(forces_y) - drag * v_y) / 1300 - r * v_x,
        1.3725 * (forces_y[0] - forces_y[1]) / 1400,
    ]
    found = sliding.rhs(np.array([v_x, v_y, r]), np.array([steer_f, kappa_f, steer_r, kappa_r]))
    assert found == pytest.approx(expected, rel=1e-14)


def test_the_slip_plant_is_mirror_symmetric(slips, states):
    u = np.random.default_rng(5).uniform(-0.3, 0.3, (200, 4))
    mirrored = slips.rhs(states * MIRROR_X, u * np.array([-1, 1, -1, 1]))  # steer changes sign, slip does not
    assert mirrored == pytest.approx(slips.rhs(states, u) * MIRROR_X, rel=1e-13, abs=1e-12)


def test_small_slips_are_the_linear_bicycle(slips):
    """v̇_y and ṙ at small angles follow the cornering stiffnesses of the textbook's linear single-track model."""
    p = slips.parameters
    v, beta, r, delta = 20.0, 1e-5, 1e-5, 2e-5
    x, u = np.array([v, v * beta, r]), np.array([delta, 0.0, 0.0, 0.0])
    C_f = C_r = 2 * p.lateral.B * p.lateral.C * p.lateral.mu * p.m * 9.81 / 4
    F_f, F_r = C_f * (delta - beta - p.l_f * r / v), C_r * (-beta + p.l_r * r / v)
    drag = 0.5 * p.c_w * p.rho * p.A * v
    dx = slips.rhs(x, u)
    assert dx[1] == pytest.approx((F_f + F_r - drag * v * beta) / p.m - r * v, rel=1e-6)
    assert dx[2] == pytest.approx((p.l_f * F_f - p.l_r * F_r) / p.Jzz, rel=1e-6)


def test_grip_scales_every_tyre_force(sliding, states):
    from dataclasses import replace

    u = np.random.default_rng(6).uniform(-0.3, 0.3, (200, 4))
    bare, double = (SlipInput(replace(sliding.parameters, mu_scale=scale)) for scale in (0.0, 2.0))
    tyres = sliding.rhs(states, u) - bare.rhs(states, u)
    assert double.rhs(states, u) - bare.rhs(states, u) == pytest.approx(2 * tyres, rel=1e-12, abs=1e-10)
    assert bare.rhs(states, u) == pytest.approx(ForceInput(sliding.parameters).rhs(states, 0 * u), abs=1e-12)


@pytest.mark.parametrize(
    ("starts", "count", "steps"),
    [
        (surface_of, 100, 50),
        (ball_of, 1000, 25),
        pytest.param(surface_of, 441, 150, marks=pytest.mark.slow),  # the paper's size
        pytest.param(ball_of, 2000, 50, marks=pytest.mark.slow),
    ],
)
def test_energy_never_grows_on_tyres(slips, starts, count, steps):
    """Every trajectory and its reverse, relative 1e-9 (a single step per sample fails by 2e-7)."""
    sample = starts(slips, count)
    for sign in (1, -1):
        x0 = sample.states * np.array([sign, sign, 1])
        u = np.zeros((len(x0), steps, 4))
        energy = slips.kinetic_energy(simulate(slips.rhs, x0, u, 0.01, fastest_rate=slips.fastest_rate))
        assert (np.diff(energy, axis=1) <= 1e-9 * energy[:, :-1]).all()
        assert (energy[:, -1] < energy[:, 0]).all()


def test_a_vehicle_without_tyres_is_refused_for_the_slip_plant(vehicle):
    from dataclasses import replace

    with pytest.raises(InvalidValueError, match=r"give the vehicle file the tables \[lateral\] and"):
        SlipInput(replace(vehicle, lateral=None))


def test_a_plant_is_remembered_through_json(slips):
    from dataclasses import asdict

    about = {"plant": "slips", "vehicle": asdict(slips.parameters), "v_eps": 0.3, "combined": "ellipse"}
    assert remembered_plant(json.loads(json.dumps(about))) == SlipInput(slips.parameters, 0.3, "ellipse")
