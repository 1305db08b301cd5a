from __future__ import annotations

import numpy as np
import pytest

from koopcli.simulation.integrate import simulate
from koopcli.vehicles.plants import PLANTS, make_plant
from koopcli.vehicles.single_track import WHEELS_PER_FORCE, ForceInput

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
        plant = make_plant(name, vehicle, force_per, 0.1)
        n_x, n_u = len(plant.states), len(plant.inputs)
        assert len(plant.states.units) == n_x
        x, u = np.ones((5, 2, n_x)), np.ones((5, 2, n_u))
        assert plant.rhs(x, u).shape == x.shape
        assert plant.rhs(np.zeros(n_x), np.zeros(n_u)) == pytest.approx(np.zeros(n_x))
