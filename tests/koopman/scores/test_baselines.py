from __future__ import annotations

from dataclasses import asdict, replace

import numpy as np
import pytest

from koopcli.koopman.predictor.coverage import coverage_of
from koopcli.koopman.scores.baselines import FORECASTS, Forecast, _exponential
from koopcli.vehicles.plants.forces import ForceInput
from tests.conftest import ball_of, box_sample, trajectories_of


def forecast(kind, plant, name="slips"):
    about = {"plant": name, "vehicle": asdict(plant.parameters)}
    states = np.random.default_rng(0).uniform(-1, 1, (20, 3))
    coverage = coverage_of(states)
    return Forecast(kind, 0.01, coverage, plant.states, plant.inputs, about)


@pytest.fixture
def start():
    return np.random.default_rng(1).uniform(-1, 1, (30, 3)) * [20, 20, 5], np.zeros((30, 20, 4))


def test_hold(sliding, start):
    x0, u = start
    assert (forecast("hold", sliding).predict(x0, u) == x0[:, np.newaxis]).all()


def test_rotation_is_exact_where_no_force_acts(vehicle, start):
    gliding = ForceInput(replace(vehicle, c_w=0.0))
    truth = trajectories_of(gliding, box_sample(30, "none"), 30, dt=1e-3)
    found = replace(forecast("rotation", gliding, "forces"), dt=1e-3).predict(truth.x[:, 0], truth.u)
    assert found == pytest.approx(truth.x, abs=1e-8)  # what Runge and Kutta leave


def test_linearisation_is_right_to_second_order(sliding):
    """Halving the time divides the error by eight: value, slope and curvature along the flow are right."""
    x0 = np.array([[20.0, 2.0, 0.5], [15.0, -3.0, 1.0], [-12.0, 4.0, 2.0]])
    one = forecast("linearisation", sliding)
    errors = []
    for dt in (4e-3, 2e-3, 1e-3):
        sample = replace(ball_of(sliding, 3), states=x0)
        truth = trajectories_of(sliding, sample, 1, dt)
        errors.append(np.abs(replace(one, dt=dt).predict(x0, truth.u) - truth.x).max())
    assert 6.5 < errors[0] / errors[1] < 9.5
    assert 6.5 < errors[1] / errors[2] < 9.5


@pytest.mark.parametrize("kind", FORECASTS)
def test_every_baseline_starts_exactly_steps_and_survives_storage(sliding, start, kind):
    x0, u = start
    one = forecast(kind, sliding)
    x = one.predict(x0, u)
    assert x.shape == (30, 21, 3)
    assert x[:, 0] == pytest.approx(x0, rel=1e-15)
    assert one.step(x0, u[:, 0]) == pytest.approx(x[:, 1], rel=1e-12)
    again = Forecast.unpack(one.pack())
    assert (again.predict(x0, u) == x).all()
    assert again.knows_inputs == (kind == "linearisation")
    assert again.predict(x0, u + 1.0)[:, 1:] == pytest.approx(x[:, 1:]) or again.knows_inputs


def test_linearisation_under_forces_is_right_to_second_order(plant):
    """Forces enter the right-hand side linearly, so that halving the time divides the error by eight with them too."""
    x0 = np.array([[20.0, 2.0, 0.5], [15.0, -3.0, 1.0], [-12.0, 4.0, 2.0]])
    u = np.random.default_rng(5).uniform(-5e3, 5e3, (3, 2, 4))
    errors = []
    for dt in (4e-3, 2e-3, 1e-3):
        truth = trajectories_of(plant, replace(box_sample(3), states=x0, inputs=u), 2, dt)
        errors.append(np.abs(replace(forecast("linearisation", plant, "forces"), dt=dt).predict(x0, u) - truth.x).max())
    assert 6.5 < errors[0] / errors[1] < 9.5
    assert 6.5 < errors[1] / errors[2] < 9.5


def test_the_exponential_of_many_matrices():
    from scipy.linalg import expm

    rng = np.random.default_rng(2)
    for size in (1e-9, 0.3, 5.0, 60.0):
        M = rng.standard_normal((40, 4, 4)) * size
        M[:20] -= 2 * size * np.eye(4)
        expected = np.stack([expm(one) for one in M])
        scale = np.abs(expected).max(axis=(1, 2), keepdims=True)
        assert _exponential(M) / scale == pytest.approx(expected / scale, abs=1e-9)
