"""The derivative of the lift: that of the splines that are used, through places, frames and composed lookups."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from koopcli.errors import InvalidValueError
from koopcli.koopman.eigen import futures
from koopcli.koopman.eigen.frames import FRAMES
from koopcli.koopman.eigen.lookup.cloud import Cloud
from koopcli.koopman.eigen.lookup.lookup import Lift
from koopcli.koopman.eigen.lookup.mls import trend_slopes, trend_weights
from koopcli.koopman.eigen.lookup.polyharmonic import (
    STIFF,
    Polyharmonic,
    _bounded,
    _bounded_with_slopes,
    _wild,
    spline_slopes,
    spline_weights,
)
from koopcli.koopman.predictor.places import place_slopes, placed
from koopcli.records import Channels, Trajectories
from koopcli.simulation import sampling
from tests.conftest import ball_of, eigen_fit, trajectories_of

AHEAD = {"window": "horizon", "kind": "comb", "pairs": 6, "cut": 1e-10}
F = np.array([[-1.0, 4.0, 0.3], [-4.0, -1.0, 0.0], [0.0, 0.5, -2.0]])


def differences(function, x, step):
    """Central differences (..., n_x) of a ``function`` of states (n, n_x), at ``x``."""
    n_x = x.shape[-1]
    return np.stack([(function(x + d) - function(x - d)) / (2 * step) for d in step * np.eye(n_x)], axis=-1)


def far_off(found, true):
    return float(np.abs(found - true).max() / np.abs(true).max())


class Held(Cloud):
    """A cloud that finds the same neighbours, whatever it is asked for."""

    def near(self, y):
        return np.tile(np.arange(len(self.places)), (len(y), 1))


def held(places, softness):
    zero = np.zeros(len(places), dtype=int)
    return Polyharmonic(Held(places, zero, zero, len(places)), softness)


@pytest.fixture(scope="module")
def places():
    return np.random.default_rng(0).uniform(-1, 1, (40, 3))


@pytest.fixture
def hold(monkeypatch):
    """Make every lookup, in the order of their calls, find again what it finds for ``x``."""

    def of(function, x):
        found, whole, calls = [], Cloud.near, [0]
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(Cloud, "near", lambda self, y: found.append(whole(self, y)) or found[-1])
            function(x)

        def again(self, y):
            calls[0] += 1
            return found[(calls[0] - 1) % len(found)]

        monkeypatch.setattr(Cloud, "near", again)

    return of


# --- the weights


@pytest.mark.parametrize("softness", [1e-4, 1e-2, 1.0])
@pytest.mark.parametrize("degree", [1, 2])
def test_slopes_of_a_spline_are_the_limit_of_its_differences(degree, softness):
    """Of order two in the step, with the softness a share of a distance that changes too."""
    places = np.random.default_rng(0).uniform(-1, 1, (40, 3))

    def around(y):
        way = places - y[:, np.newaxis]
        return way / np.sqrt((way**2).sum(axis=2).max(axis=1))[:, np.newaxis, np.newaxis]

    y = np.zeros((1, 3))
    size = np.sqrt((places**2).sum(axis=1).max())
    slopes = spline_slopes(around(y), degree, softness)[1] / size
    coarse, fine = (
        far_off(differences(lambda at: spline_weights(around(at), degree, softness), y, step), slopes)
        for step in (1e-2, 1e-3)
    )
    assert coarse < 2e-3
    assert coarse / fine == pytest.approx(100, rel=0.1)


def test_slopes_of_the_trend_are_the_limit_of_its_differences(places):
    y = np.zeros((1, 3))
    weights, slopes = trend_slopes(places[np.newaxis])
    assert weights == pytest.approx(trend_weights(places[np.newaxis]), abs=1e-14)
    coarse, fine = (
        far_off(differences(lambda at: trend_weights(places - at[:, np.newaxis]), y, step), slopes)
        for step in (1e-2, 1e-3)
    )
    assert coarse < 2e-3
    assert coarse / fine == pytest.approx(100, rel=0.1)


@pytest.mark.parametrize("softness", [STIFF, 1e-2])
def test_slopes_know_every_quadratic(places, softness):
    """A spline that meets its nodes reads off their gradient, and a soft one no less: its tail is a quadratic."""
    y = np.random.default_rng(1).uniform(-0.5, 0.5, (6, 3))
    _, weights, slopes = held(places, softness).with_slopes(y)
    Q = np.random.default_rng(2).standard_normal((3, 3))
    values = 1.0 + places @ [1.0, -2.0, 0.5] + np.einsum("qi,ij,qj->q", places, Q, places)
    assert slopes.sum(axis=1) == pytest.approx(np.zeros((6, 3)), abs=1e-7)
    assert np.einsum("nqi,q->ni", slopes, values) == pytest.approx([1.0, -2.0, 0.5] + y @ (Q + Q.T), abs=1e-6)
    assert np.einsum("nq,q->n", weights, values) == pytest.approx(
        1.0 + y @ [1.0, -2.0, 0.5] + np.einsum("ni,ij,nj->n", y, Q, y), abs=1e-6
    )


@pytest.mark.parametrize(("flat", "away", "linear"), [(3e-2, 0.05, True), (3e-2, 0.4, False), (1e-4, 0.05, False)])
def test_where_a_simpler_spline_is_taken_the_slopes_are_its_own(flat, away, linear):
    """Neighbours nearly in a plane, and a place beside it: the linear tail, softer splines, and in the end a trend."""
    g = np.random.default_rng(3)
    near = g.uniform(-1, 1, (1, 40, 3)) * [1, 1, flat]
    places = near + np.array([0.0, 0.0, away])
    size = np.sqrt((places**2).sum(axis=2).max())
    weights, slopes = _bounded_with_slopes(places / size, STIFF)
    assert _wild(spline_weights(places / size, 2, STIFF)).all()
    assert _wild(spline_weights(places / size, 1, STIFF)).all() != linear
    assert weights == pytest.approx(_bounded(places / size, STIFF), abs=1e-8)

    def moved(y):
        way = places - y[:, np.newaxis]
        return _bounded(way / np.sqrt((way**2).sum(axis=2).max()), STIFF)

    assert far_off(differences(moved, np.zeros((1, 3)), 1e-4), slopes / size) < 1e-5


def test_weights_are_alike_with_slopes_and_without(places):
    y = np.random.default_rng(1).uniform(-0.9, 0.9, (300, 3))
    near, weights = held(places, STIFF)(y)
    again, with_slopes, slopes = held(places, STIFF).with_slopes(y)
    assert (near == again).all()
    assert with_slopes == pytest.approx(weights, abs=1e-9)
    assert slopes.shape == (300, 40, 3)


@pytest.mark.parametrize("power", [1.0, 0.5, 0.2])
def test_slopes_of_places(power):
    x, scale = np.random.default_rng(0).standard_normal((20, 3)), np.array([30.0, 12.0, 3.0])
    found = differences(lambda at: placed(at, scale, power), x, 1e-5)
    assert place_slopes(x, scale, power) == pytest.approx(found, rel=1e-6, abs=1e-9)
    assert np.isfinite(place_slopes(np.zeros((1, 3)), scale, power)).all()


# --- the lift


@pytest.fixture(scope="module")
def linear():
    """Trajectories of a linear system in three dimensions."""
    step = expm(F * 0.01).T
    x = np.empty((120, 81, 3))
    x[:, 0] = sampling.ball(0, 120)
    for k in range(80):
        x[:, k + 1] = x[:, k] @ step
    channels = Channels(("a", "b", "c"), ("1",) * 3)
    return Trajectories(x, np.zeros((120, 80, 1)), 0.01, channels, Channels(("u",), ("1",)))


@pytest.fixture(scope="module")
def rolling(sliding):
    return trajectories_of(sliding, ball_of(sliding, 240, 3), 80)


@pytest.mark.parametrize("lookup_steps", [None, 15])
def test_the_derivative_of_a_linear_system_is_its_exponential(linear, lookup_steps):
    """And that of the lift is the projection of it."""
    lift = eigen_fit(linear, **AHEAD, lift="polyharmonic", tabulated=40, nodes=8, lookup_steps=lookup_steps).observables
    x = 0.5 * sampling.ball(5, 30)
    exact = np.stack([expm(F * 0.01 * k) for k in range(41)])
    assert lift.future_derivative(x) == pytest.approx(np.broadcast_to(exact, (30, 41, 3, 3)), abs=1e-6)
    blocks = np.einsum("lk,kij->ilj", lift.projection, exact).reshape(-1, 3)
    assert far_off(lift.derivative(x), np.broadcast_to(blocks, (30, lift.functions, 3))) < 1e-5


@pytest.mark.parametrize("lookup_steps", [None, 6])
@pytest.mark.parametrize("frame", FRAMES)
def test_it_is_the_limit_of_differences_among_the_same_neighbours(rolling, frame, lookup_steps, hold):
    """Of order two in the step, by one lookup and by five that each begin where the last one ends."""
    lift = eigen_fit(
        rolling, **AHEAD, lift="polyharmonic", frame=frame, tabulated=50, nodes=20, spacing=3, power=0.5,
        horizon=28, lookup_steps=lookup_steps,
    ).observables  # fmt: skip
    x = spread_of(rolling)
    lifted, slopes = lift.with_slopes(x)
    after, turning = lift.future_with_slopes(x)
    assert lifted == pytest.approx(lift.lift(x), rel=1e-5, abs=1e-5)
    assert after == pytest.approx(lift.future(x), abs=1e-7)
    assert slopes.shape == (40, lift.functions, 3)
    exactly = 1e-12 if frame == "world" else 0.1  # where the state itself is interpolated over other distances
    assert turning[:, 0] == pytest.approx(np.broadcast_to(np.eye(3), (40, 3, 3)), abs=exactly)
    hold(lift.future, x)
    errors = [
        np.median(np.abs(differences(lift.future, x, step) - turning).max(axis=(1, 2, 3))) for step in (1e-2, 1e-3)
    ]
    assert errors[0] < 1e-3
    assert errors[0] / errors[1] == pytest.approx(100, rel=0.2)
    assert far_off(differences(lift.lift, x, 1e-3), slopes) < 1e-3


def spread_of(trajectories):
    """Forty states between those of the trajectories."""
    return np.asarray(trajectories.x)[:40, :30].mean(axis=1)


def test_it_is_alike_from_a_table_and_without_one(rolling, monkeypatch):
    lift = eigen_fit(rolling, **AHEAD, lift="polyharmonic", frame="world", tabulated=50, nodes=10).observables
    x = spread_of(rolling)
    from_table = lift.derivative(x)
    monkeypatch.setattr(futures, "LARGEST_TABLE", 1.0)
    monkeypatch.setattr(futures, "GATHERED", 7)
    monkeypatch.setattr(futures, "TOGETHER", 9)
    assert lift.derivative(x) == pytest.approx(from_table, rel=1e-9, abs=1e-9)
    assert lift.derivative(x[:0]).shape == (0, lift.functions, 3)


def test_a_state_that_is_not_finite_has_none(rolling):
    lift = eigen_fit(rolling, **AHEAD, lift="polyharmonic", frame="world", tabulated=50, nodes=10).observables
    x = np.array([[20.0, 1.0, 0.5], [np.nan, 0.0, 0.0]])
    found = lift.derivative(x)
    assert np.isfinite(found[0]).all()
    assert np.isnan(found[1]).all()


@pytest.mark.parametrize("kind", [kind for kind, lift in Lift.kinds().items() if not lift.smooth])
def test_other_lookups_have_none(rolling, kind):
    lift = eigen_fit(rolling, **AHEAD, lift=kind, tabulated=50, nodes=6).observables
    with pytest.raises(InvalidValueError, match=f"the lift '{kind}' has no derivative in the state, .*'polyharmonic'"):
        lift.derivative(np.ones((1, 3)))
