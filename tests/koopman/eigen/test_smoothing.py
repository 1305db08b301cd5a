"""Trajectories without their noise: the criterion against the likelihood itself, exactness, world axes, detection."""

from __future__ import annotations

import numpy as np
import pytest

from koopcli.errors import InvalidValueError
from koopcli.koopman.eigen import windows
from koopcli.koopman.eigen.lookup.polyharmonic import SOFTER, PolyharmonicLift, spline_weights
from koopcli.koopman.eigen.smoothing import STRENGTHS, noisy, smoothed
from koopcli.progress import silent
from koopcli.records import Channels, Trajectories
from koopcli.simulation.noise import measured
from tests.conftest import ball_of, eigen_fit, trajectories_of

SIGMA = np.array([0.1, 0.1, 0.01])


def test_the_strength_has_the_largest_restricted_likelihood():
    """That of contrasts K y, which no straight line moves, of a line with noise 1 and second differences 1/L, as the
    density of a normal vector says it, with its scale at the best.
    """
    n, rng = 12, np.random.default_rng(2)
    y = np.cumsum(np.cumsum(rng.standard_normal((1, n)))) / 4 + rng.standard_normal((1, n))
    D = np.diff(np.eye(n), 2, axis=0)
    line = np.stack([np.ones(n), np.arange(n)], axis=1)
    K = np.linalg.svd(line.T)[2][2:]
    likelihoods, smooth, variances = [], [], []
    for L in STRENGTHS:
        Sigma = K @ (np.eye(n) + np.linalg.pinv(D.T @ D) / L) @ K.T
        variance = (K @ y[0]) @ np.linalg.solve(Sigma, K @ y[0]) / (n - 2)
        likelihoods.append(-0.5 * np.linalg.slogdet(variance * Sigma)[1])
        smooth.append(np.linalg.solve(np.eye(n) + L * D.T @ D, y[0]))
        variances.append(variance)
    best = int(np.argmax(likelihoods))
    assert 0 < best < len(STRENGTHS) - 1
    x, variance = smoothed(y[..., np.newaxis], 0.01, turns=False)
    assert x[0, :, 0] == pytest.approx(smooth[best], abs=1e-9)
    assert variance[0, 0] == pytest.approx(variances[best])


def test_it_finds_the_noise_and_takes_most_of_it_away(rolling):
    x = np.asarray(rolling.x)
    noise = measured(x, 0, SIGMA, 0) - x
    smooth, variance = smoothed(x + noise, rolling.dt, turns=True)
    assert np.sqrt(variance.mean(axis=0))[:2] == pytest.approx(SIGMA[:2], rel=0.05)
    assert np.sqrt(variance.mean(axis=0))[2] == pytest.approx(SIGMA[2], rel=0.3)  # which moves fast for its noise
    assert (np.sqrt(((smooth - x) ** 2).mean(axis=(0, 1))) < [0.055, 0.055, 0.009]).all()


def test_a_car_without_forces_is_smoothed_exactly_in_axes_that_stay():
    """A puck that slides and spins: its velocity turns with the car, and stands still in the world."""
    t, r = 0.01 * np.arange(60.0), 3.0
    x = np.stack([10 * np.cos(r * t), -10 * np.sin(r * t), np.full(60, r)], axis=1)[np.newaxis]
    smooth, variance = smoothed(x, 0.01, turns=True)
    assert smooth == pytest.approx(x, abs=1e-9)
    assert variance.max() < 1e-20
    noise = measured(x, 0, SIGMA, 0) - x
    errors = [np.abs(smoothed(x + noise, 0.01, turns=turns)[0] - x)[..., :2].mean() for turns in (True, False)]
    assert errors[0] < 0.8 * errors[1]


def test_noise_is_seen_where_there_is_some(rolling):
    x = np.asarray(rolling.x)
    assert not noisy(x)
    assert noisy(measured(x, 0, 0.1 * SIGMA, 0))
    assert noisy(measured(x, 0, SIGMA, 0, memory=0.8))
    assert not noisy(measured(x, 0, SIGMA, 0)[:, :6])  # too short to tell


@pytest.mark.parametrize("samples", [2, 6])
def test_short_trajectories_are_not_smoothed(samples):
    with pytest.raises(InvalidValueError, match=f"trajectories of {samples} samples are too short to tell noise"):
        smoothed(np.zeros((4, samples, 3)), 0.01, turns=True)


# --- soft splines


@pytest.mark.parametrize("softness", SOFTER)
def test_soft_splines_meet_quadratic_functions_still(softness):
    near = np.random.default_rng(0).uniform(-1, 1, (5, 40, 3)) / 2
    weights = spline_weights(near, 2, softness)
    for f in (lambda p: 1.0 + p[..., 0], lambda p: p[..., 0] * p[..., 1] - p[..., 2] ** 2 + 2.0):
        assert (weights * f(near)).sum(axis=1) == pytest.approx(f(np.zeros((5, 3))), abs=1e-6)
    assert np.abs(weights).sum(axis=1).max() < np.abs(spline_weights(near, 2, SOFTER[0])).sum(axis=1).max() + 1e-9


@pytest.mark.parametrize("lowest", range(7))
def test_the_lowest_place_of_a_valley_is_found(lowest):
    asked = []

    def value(place: int) -> float:
        asked.append(place)
        return abs(place - lowest)

    assert windows._lowest(value, 7, silent) == lowest
    assert len(set(asked)) == len(asked)


def test_noisy_nodes_have_softer_splines_and_predict_better():
    """Of a linear system, whose futures are smooth functions of the state: what a spline follows else is noise."""
    F = np.array([[-1.0, 4.0, 0.3], [-4.0, -1.0, 0.0], [0.0, 0.5, -2.0]])
    rates, V = np.linalg.eig(F)
    t = 0.01 * np.arange(61)

    def flow(seed: int, count: int) -> np.ndarray:
        start = np.random.default_rng(seed).uniform(-1, 1, (count, 3))
        z = (start @ np.linalg.inv(V).T)[:, np.newaxis] * np.exp(np.outer(t, rates))
        return np.asarray((z @ V.T).real)

    states = Channels(("a", "b", "c"), ("1",) * 3)
    x, test = flow(0, 100), flow(1, 40)
    data = Trajectories(x, np.zeros((100, 60, 1)), 0.01, states, Channels(("u",), ("1",)))
    how = {"window": "horizon", "kind": "comb", "pairs": 4, "cut": 1e-8, "lift": "polyharmonic", "tabulated": 30}
    how |= {"horizon": 30, "neighbours": 30, "spacing": 4}

    def error(sigma: float, **more) -> tuple[float | None, float]:
        noise = measured(x, 0, np.full(3, sigma), 0)
        fitted = Trajectories(noise, data.u, 0.01, states, data.input_channels)
        predictor = eigen_fit(fitted, **how, **more)
        lift = predictor.observables.nodes.search.lift
        assert isinstance(lift, PolyharmonicLift)
        return lift.softness, float(np.abs(predictor.predict(test[:, 0], steps=30) - test[:, :31]).mean())

    stiff, soft = error(0.02), error(0.02, smooth=True)
    assert stiff[0] is None
    assert soft[0] > SOFTER[1]
    assert soft[1] < 0.6 * stiff[1]
    assert error(0.0, smooth=True)[1] < 1e-5
    assert error(0.02, smooth=True, softness=1e-3)[0] == 1e-3  # which was said


@pytest.fixture(scope="module")
def rolling(sliding):
    return trajectories_of(sliding, ball_of(sliding, 120, 3), 100)
