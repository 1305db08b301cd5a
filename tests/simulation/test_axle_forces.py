"""The coasting car under changes of its axle forces, and the test states of such a car."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from koopcli.errors import InvalidValueError
from koopcli.koopman.eigen.forces import CHANGES, force_matrix
from koopcli.koopman.scores.baselines import Forecast
from koopcli.progress import silent
from koopcli.simulation import sampling
from koopcli.simulation.integrate import simulate
from koopcli.simulation.samples.ball import BallSample
from koopcli.simulation.samples.ball_forces import BallForcesSample
from koopcli.vehicles.axles import Axles
from koopcli.vehicles.parameters import VehicleParameters
from koopcli.vehicles.plants.slips import SlipInput, Slips
from koopcli.vehicles.plants.slips_axle_forces import AxleForces, ForceChange, driven
from tests.conftest import ball_of


@pytest.fixture(scope="module", params=["none", "ellipse"])
def plants(request, vehicle):
    """The car under changes of axle forces, and the coasting one."""
    return ForceChange(vehicle, 0.2, request.param), SlipInput(vehicle, 0.2, request.param)


def sampled(vehicle, **changed):
    return BallForcesSample(**{"count": 20, "vehicle": vehicle, **changed}).sampled(silent)


# --- the plant


def test_without_forces_the_car_coasts_to_the_last_bit(plants):
    """Derivatives, substeps and trajectories of the plant without forces are those of `slips`."""
    pushed, coasting = plants
    x, u = ball_of(coasting, 60, 4).x0, np.zeros((60, 30, 4))
    assert np.array_equal(pushed.rhs(x, u[:, 0]), coasting.rhs(x, u[:, 0]))
    assert np.array_equal(pushed.fastest_rate(x, u[:, 0], 0.01), coasting.fastest_rate(x, u[:, 0], 0.01))
    ways = [simulate(plant.rhs, x, u, 0.01, fastest_rate=plant.fastest_rate) for plant in plants]
    assert np.array_equal(*ways)


def test_forces_change_momentum_as_their_sum_says(plants):
    """m a and J_zz times the turning differ from those of the coasting car by the sums of forces and of moments."""
    pushed, coasting = plants
    p, g = pushed.parameters, np.random.default_rng(2)
    x, u = ball_of(coasting, 50, 5).x0, g.uniform(-5e3, 5e3, (50, 4))
    change = pushed.rhs(x, u) - coasting.rhs(x, np.zeros_like(u))
    assert np.allclose(p.m * change[:, 0], u[:, 0] + u[:, 2], rtol=0, atol=1e-9 * 5e3)
    assert np.allclose(p.m * change[:, 1], u[:, 1] + u[:, 3], rtol=0, atol=1e-9 * 5e3)
    assert np.allclose(p.Jzz * change[:, 2], p.l_f * u[:, 1] - p.l_r * u[:, 3], rtol=0, atol=1e-9 * 5e3)
    power = (p.m * x[:, :2] * change[:, :2]).sum(axis=1) + p.Jzz * x[:, 2] * change[:, 2]
    at_axles = (u[:, 0] + u[:, 2]) * x[:, 0] + u[:, 1] * (x[:, 1] + p.l_f * x[:, 2])
    assert np.allclose(power, at_axles + u[:, 3] * (x[:, 1] - p.l_r * x[:, 2]), rtol=1e-9, atol=1e-6)


def test_it_takes_the_inputs_of_predictors_with_force_inputs(plants, vehicle):
    """The same channels, and the same constant matrix G."""
    assert ForceChange.inputs == CHANGES
    pushed, x, zero = plants[0], np.array([[20.0, 1, 0.5]]), np.zeros((1, 4))
    columns = [pushed.rhs(x, 1e3 * np.eye(4)[i : i + 1]) - pushed.rhs(x, zero) for i in range(4)]
    assert np.allclose(np.concatenate(columns).T, 1e3 * force_matrix(vehicle), rtol=1e-9, atol=1e-12)


def test_forces_may_bring_a_slide_to_rest_sooner(plants):
    """Where forces may bring a sliding wheel to rest within a sample, the rate that is resolved rises."""
    pushed, x = plants[0], np.array([[2.0, 3.0, 0.0]])
    calm, strong = (pushed.fastest_rate(x, np.array([[0.0, -F, 0, -F]]), 0.01) for F in (0.0, 2e4))
    assert strong > calm


def test_chosen_substeps_follow_forces_as_finely_as_many_do(plants):
    """The error of the chosen steps of a strongly pushed car is far below what predictors err by."""
    pushed = plants[0]
    x0, u, _ = sampled(pushed.parameters, count=25, grip_share=1.0)

    def finely(x, u, dt):
        return np.full(len(x), 64.0 / dt)

    ways = [simulate(pushed.rhs, x0, u, 0.01, fastest_rate=rate) for rate in (pushed.fastest_rate, finely)]
    off = np.linalg.norm(ways[0] - ways[1], axis=(1, 2)) / np.linalg.norm(ways[1], axis=(1, 2))
    assert off.max() < 1e-3


def test_a_vehicle_without_tyres_is_refused():
    """The plant and its sample say what the vehicle lacks, in one line."""
    bare = VehicleParameters(m=1200.0, Jzz=1500.0, l_f=1.2, l_r=1.5, c_w=0.3, A=2.0, rho=1.2)
    for make in (AxleForces().of, lambda car: BallForcesSample(vehicle=car).check()):
        with pytest.raises(InvalidValueError, match=r"axle-forces.*tables") as caught:
            make(bare)
        assert "\n" not in str(caught.value)


def test_it_coasts_as_the_plant_that_it_is_around():
    """The settings of the coasting plant are taken over."""
    assert AxleForces.around(Slips(0.3, "ellipse")) == AxleForces(0.3, "ellipse")
    assert driven({"plant": "slips", "v_eps": 0.3}) == {"plant": "axle-forces", "v_eps": 0.3}
    assert driven({"plant": "wheels"}) == {"plant": "wheels"}


# --- the sample


def test_states_are_those_of_the_ball(vehicle):
    """With one seed both kinds draw the same states."""
    alike = BallSample(count=20, seed=3, m=vehicle.m, Jzz=vehicle.Jzz).sampled(silent)
    assert np.array_equal(sampled(vehicle, seed=3).states, alike.states)
    assert not np.array_equal(sampled(vehicle, seed=4).states, alike.states)


def test_forces_are_held_and_within_their_share_of_the_grip(vehicle):
    """Steps of a stretch have the same forces, others have others; the last stretch may be shorter."""
    u = sampled(vehicle, count=400, grip_share=0.3, hold=4, steps=10).inputs
    assert u.shape == (400, 10, 4)
    for start, stop in ((0, 4), (4, 8), (8, 10)):
        assert (u[:, start:stop] == u[:, start : start + 1]).all()
    assert (u[:, 3] != u[:, 4]).all()
    assert (u[:, 7] != u[:, 8]).all()
    share = np.abs(u) / np.repeat(2 * Axles(vehicle, 0.1, "none").grip, 2)
    assert share.max() <= 0.3
    assert (share.max(axis=(0, 1)) > 0.29).all()
    assert (np.abs(u.mean(axis=(0, 1))) < 0.1 * np.abs(u).max()).all()


def test_the_seed_pins_forces_and_the_share_scales_them(vehicle):
    """The same seed gives the same forces, a share twice as large twice as large ones."""
    once, again, other = (sampled(vehicle, seed=seed).inputs for seed in (1, 1, 2))
    assert np.array_equal(once, again)
    assert not np.array_equal(once, other)
    assert np.allclose(sampled(vehicle, seed=1, grip_share=0.8).inputs, 2 * once, rtol=1e-15)


def test_more_states_change_no_force_of_the_first(vehicle):
    """The first trajectories of a larger sample have the same forces."""
    assert np.array_equal(sampled(vehicle, count=30).inputs[:20], sampled(vehicle, count=20).inputs)


# --- the baseline


def test_the_linearisation_knows_what_forces_do(vehicle):
    """One short step of it under forces differs from one without by dt G ΔF, but for what is of second order in dt."""
    coverage, plant = None, {"plant": "axle-forces", "vehicle": vars(vehicle)}
    x, g = sampling.ball(1, 20) * [30.0, 30, 8], np.random.default_rng(1)
    u = g.uniform(-3e3, 3e3, (20, 1, 4))
    errors = []
    for dt in (2e-4, 1e-4):
        about = Forecast("linearisation", dt, coverage, ForceChange.states, ForceChange.inputs, plant)
        change = about.predict(x, u)[:, 1] - about.predict(x, 0 * u)[:, 1]
        errors.append(np.linalg.norm(change / dt - u[:, 0] @ force_matrix(vehicle).T, axis=1))
    assert np.median(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.1)
    assert not replace(about, kind="hold").knows_inputs
