"""Lifted states fitted to the horizon ahead: frames, exactness, continuation, mirror images, trust."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from koopcli.choices import names_of
from koopcli.errors import InvalidValueError
from koopcli.koopman import stored
from koopcli.koopman.eigen import futures
from koopcli.koopman.eigen.fit import with_images
from koopcli.koopman.eigen.frames import FRAMES, check_frame, yaw
from koopcli.koopman.eigen.lookup.lookup import Lift
from koopcli.koopman.predictor.coverage import spread
from koopcli.koopman.predictor.trust import LEVEL, calibrated
from koopcli.koopman.scores.metrics import rmse
from koopcli.records import Channels, Trajectories
from koopcli.simulation import sampling
from koopcli.vehicles.symmetry import images
from tests.conftest import ball_of, eigen_fit, trajectories_of

AHEAD = {"window": "horizon", "kind": "comb", "pairs": 6, "cut": 1e-10}


F = np.array([[-1.0, 4.0, 0.3], [-4.0, -1.0, 0.0], [0.0, 0.5, -2.0]])


def spread_of(trajectories):
    """Forty states between those of the trajectories."""
    return np.asarray(trajectories.x)[:40, :30].mean(axis=1)


@pytest.fixture(scope="module")
def linear():
    """Trajectories of a linear system in three dimensions."""
    x0 = sampling.ball(0, 120)
    step = expm(F * 0.01).T
    x = np.empty((120, 81, 3))
    x[:, 0] = x0
    for k in range(80):
        x[:, k + 1] = x[:, k] @ step
    channels = Channels(("a", "b", "c"), ("1",) * 3)
    return Trajectories(x, np.zeros((120, 80, 1)), 0.01, channels, Channels(("u",), ("1",)))


@pytest.fixture(scope="module")
def rolling(sliding):
    """Trajectories from the volume inside Γ, and test trajectories."""
    return (
        trajectories_of(sliding, ball_of(sliding, 240, 3), 80),
        trajectories_of(sliding, ball_of(sliding, 300, 4), 30),
    )


# --- frames


@pytest.mark.parametrize("frame", FRAMES)
def test_a_future_survives_its_frame(frame, rolling):
    x = np.asarray(rolling[0].x)
    there = FRAMES[frame].seen(x, 0.01)
    assert FRAMES[frame].back(there, x[:, 0], 0.01) == pytest.approx(x, abs=1e-11)


def test_nothing_changes_in_the_world_without_forces():
    """A puck that slides and spins: in body axes its velocity turns, in the world it stays."""
    t, r = 0.01 * np.arange(50.0), 3.0
    x = np.stack([10 * np.cos(r * t), -10 * np.sin(r * t), np.full(50, r)], axis=1)[np.newaxis]
    assert FRAMES["world"].seen(x, 0.01) == pytest.approx(np.zeros((1, 50, 3)), abs=1e-12)
    assert yaw(x[..., 2], 0.01)[0] == pytest.approx(r * t)


def test_world_coordinates_need_a_body_in_the_plane():
    check_frame("world", Channels(("v_x", "v_y", "yaw_rate", "omega"), ("m/s", "m/s", "rad/s", "rad/s")))
    check_frame("state", Channels(("a",), ("1",)))
    with pytest.raises(InvalidValueError, match="need the states v_x, v_y, yaw_rate first, got a, b"):
        check_frame("world", Channels(("a", "b"), ("1", "1")))


# --- the lift


@pytest.mark.parametrize("lift", ["linear", "polyharmonic"])
def test_a_linear_system_is_predicted_as_well_as_exponentials_hold_it(linear, lift):
    """What follows is linear in the state, which linear interpolation does not blur."""
    predictor = eigen_fit(linear, **AHEAD, lift=lift, tabulated=40, nodes=8)
    inside = 0.5 * sampling.ball(5, 60)
    F = np.array([[-1.0, 4.0, 0.3], [-4.0, -1.0, 0.0], [0.0, 0.5, -2.0]])
    true = np.stack([inside @ expm(F * 0.01 * k).T for k in range(41)], axis=1)
    assert rmse(predictor.predict(inside, steps=40), true).max() < 2 * predictor.regression.missed + 1e-3
    assert predictor.regression.missed < 0.05
    assert predictor.functions == 3 * 14


@pytest.mark.parametrize("frame", FRAMES)
def test_at_a_node_it_is_the_projected_future(rolling, frame):
    data, _ = rolling
    predictor = eigen_fit(data, **AHEAD, lift="linear", frame=frame, tabulated=50)
    lifted = predictor.observables
    x = np.asarray(data.x)[5:25, 17]
    ahead = np.asarray(data.x)[5:25, 17:48]
    assert lifted.future(x) == pytest.approx(ahead, abs=1e-8)
    found = predictor.predict(x, steps=30)
    assert rmse(found, ahead).max() < 1.0
    z = predictor.lift(x)
    assert z.shape == (20, 42)
    assert z.reshape(20, 3, 14) == pytest.approx(np.matmul(lifted.projection, ahead).transpose(0, 2, 1), abs=1e-6)


@pytest.mark.parametrize("frame", FRAMES)
def test_what_is_too_large_for_a_table_is_gathered_alike(rolling, frame, monkeypatch):
    data, test = rolling
    lifted = eigen_fit(data, **AHEAD, lift="linear", frame=frame, tabulated=50, nodes=6).observables
    x0 = np.asarray(test.x)[:, 0]
    from_table = lifted.future(x0)
    monkeypatch.setattr(futures, "LARGEST_TABLE", 1.0)
    monkeypatch.setattr(futures, "GATHERED", 7)
    assert lifted.future(x0) == pytest.approx(from_table, rel=1e-12, abs=1e-12)
    assert np.isfinite(from_table).all()


def test_the_first_sample_is_the_state_itself(rolling):
    """In world coordinates exactly so, before exponentials are fitted."""
    data, test = rolling
    predictor = eigen_fit(data, **AHEAD, lift="polyharmonic", frame="world", tabulated=50, nodes=10)
    x0 = np.asarray(test.x)[:, 0]
    assert predictor.observables.future(x0)[:, 0] == pytest.approx(x0, abs=1e-12)
    assert rmse(predictor.predict(x0, steps=0), x0[:, np.newaxis]).mean() < 0.05


@pytest.mark.parametrize("lift", Lift.kinds())
def test_it_survives_storage(rolling, lift):
    data, test = rolling
    spaced = {"spacing": 2} if "spacing" in names_of(Lift.kinds()[lift]) else {}
    predictor = eigen_fit(data, **AHEAD, lift=lift, frame="world", tabulated=50, nodes=6, trust=True, **spaced)
    again = stored.predictor(predictor.pack())
    x0 = np.asarray(test.x)[:, 0]
    assert (again.predict(x0, steps=30) == predictor.predict(x0, steps=30)).all()
    assert (again.bound(x0) == predictor.bound(x0)).all()
    assert (again.regression.missed, again.beyond, again.horizon) == (predictor.regression.missed, predictor.beyond, 30)
    assert "A" not in predictor.pack().arrays


def test_a_state_that_is_not_finite_has_no_prediction(rolling):
    predictor = eigen_fit(rolling[0], **AHEAD, lift="linear", frame="world", tabulated=50, nodes=6, trust=True)
    x = np.array([[np.nan, 0, 0], [10.0, 1.0, 0.5]])
    found = predictor.predict(x, steps=5)
    assert np.isnan(found[0]).all()
    assert np.isfinite(found[1]).all()
    assert np.isnan(predictor.bound(x)).tolist() == [True, False]


def test_states_that_are_counted_as_outside_are_those_that_fall_back(rolling):
    """The hull that evaluations report is that of the nodes; beyond it `linear` takes the nearest of them."""
    data, test = rolling
    predictor = eigen_fit(data, **AHEAD, lift="linear", tabulated=50, nodes=6)
    x0 = np.asarray(test.x)[:, 0]
    _, weights = predictor.observables.nodes.find(x0)
    fallen = (weights == [1, 0, 0, 0]).all(axis=1)
    assert 5 < fallen.sum() < 295
    assert (fallen == predictor.coverage.outside(x0)).all()
    assert predictor.beyond == "take the nearest sample"


# --- more from the same data


def test_trajectories_that_are_continued_give_more_nodes_and_smaller_errors(rolling):
    data, test = rolling
    given = {**AHEAD, "lift": "polyharmonic", "frame": "world", "horizon": 30, "power": 0.5, "spacing": 4}
    plain = eigen_fit(data, **given, tabulated=50)
    more = eigen_fit(data, **given, tabulated=80, rounds=1)
    assert len(more.observables.nodes.kept) == 240 * 81
    assert more.observables.trajectories.shape == (240, 111, 3)
    assert (more.observables.trajectories[:, :81] == data.x).all()
    x0 = np.asarray(test.x)[:, 0]
    before, after = (rmse(one.predict(x0, steps=30), np.asarray(test.x)) for one in (plain, more))
    assert after.mean() < 0.95 * before.mean()


def test_continued_ends_are_what_the_predictor_says(rolling):
    data, _ = rolling
    given = {**AHEAD, "lift": "linear", "frame": "world", "horizon": 30}
    plain, more = eigen_fit(data, **given, tabulated=50), eigen_fit(data, **given, tabulated=80, rounds=1)
    ends = np.asarray(data.x)[:, -1]
    assert more.observables.trajectories[:, 81:] == pytest.approx(plain.observables.future(ends)[:, 1:], abs=1e-12)


def test_a_window_that_is_too_short(rolling):
    data, _ = rolling
    for given, says in (
        ({"tabulated": 60, "horizon": 30}, r"do not hold the horizon of 0\.3 s after each of the first 0\.6 s"),
        ({"tabulated": 50, "horizon": 90}, r"'fit-eigen\.horizon' of 0\.9 s is longer than trajectories of 0\.8 s"),
        ({"tabulated": 90, "horizon": 30, "rounds": 1}, r"'fit-eigen\.tabulate' of 0\.9 s is longer"),
        ({"tabulated": 80}, r"'fit-eigen\.tabulate' of 0\.8 s leaves nothing"),
        ({"tabulated": 70, "horizon": 10}, r"14 rates are too many for windows of 10 steps"),
    ):
        with pytest.raises(InvalidValueError, match=says):
            eigen_fit(data, **AHEAD, lift="linear", **given)


def test_images_are_data_and_make_the_predictor_symmetric(rolling, sliding):
    data, test = rolling
    signs = images(("left-right", "front-rear"), sliding.parameters, sliding.states.names)
    more = with_images(data, signs)
    assert len(more) == 4 * len(data)
    given = {**AHEAD, "lift": "polyharmonic", "frame": "world", "tabulated": 50, "nodes": 10}
    predictor = eigen_fit(more, images=4, **given)
    x0 = np.asarray(test.x)[:, 0]
    found = predictor.predict(x0, steps=30)
    plain = eigen_fit(data, **given).predict(x0, steps=30)
    for one in signs:
        mirrored = predictor.predict(x0 * one, steps=30)
        assert np.median(rmse(mirrored, found * one)) < 0.2 * np.median(rmse(plain, np.asarray(test.x)))
    assert rmse(found, np.asarray(test.x)).mean() < 0.7 * rmse(plain, np.asarray(test.x)).mean()
    driven = replace(data, u=np.ones(data.u.shape))
    with pytest.raises(InvalidValueError, match="these trajectories have inputs"):
        with_images(driven, signs)
    assert with_images(driven, []) is driven


# --- trust


def test_a_bound_covers_what_it_says():
    """Errors drawn around a level that changes from place to place: nine of ten lie below."""
    rng = np.random.default_rng(0)
    scale = np.array([10.0, 10.0, 5.0])

    def errors(x):
        return np.exp(3 * np.linalg.norm(x / scale, axis=1) + 0.5 * rng.standard_normal(len(x)))

    known, asked = sampling.ball(1, 3000) * scale, sampling.ball(2, 4000) * scale
    trust = calibrated(known, errors(known), np.arange(3000), scale, 1.0)
    bound, actual = trust.bound(asked), errors(asked)
    assert (actual <= bound).mean() == pytest.approx(LEVEL, abs=0.02)
    middle = np.linalg.norm(asked / scale, axis=1) < 0.5
    for part in (middle, ~middle):  # and in every place, not only on the whole
        assert (actual <= bound)[part].mean() == pytest.approx(LEVEL, abs=0.04)
    assert np.median(bound[~middle]) > 2 * np.median(bound[middle])


def test_the_trust_of_a_fit_covers_test_states(rolling):
    data, test = rolling
    predictor = eigen_fit(data, **AHEAD, lift="polyharmonic", frame="world", tabulated=50, nodes=10, trust=True)
    x0, true = np.asarray(test.x)[:, 0], np.asarray(test.x)
    error, bound = rmse(predictor.predict(x0, steps=30), true), predictor.bound(x0)
    assert 0.84 < (error <= bound).mean() < 0.98
    assert np.corrcoef(np.log(error), np.log(bound))[0, 1] > 0.5
    assert eigen_fit(data, **AHEAD, lift="linear", tabulated=50, nodes=10).bound(x0) is None


def test_held_back_states_are_predicted_without_their_own_trajectory(rolling):
    """With it they would be met: the estimate would be far too small."""
    data = replace(rolling[0], x=rolling[0].x[:80], u=rolling[0].u[:80])
    predictor = eigen_fit(data, **AHEAD, lift="linear", frame="world", tabulated=50, trust=True)
    chosen = spread(80 * 51, 3000)
    x = np.asarray(data.x)
    own = rmse(
        predictor.predict(x[chosen // 51, chosen % 51], steps=30),
        np.stack([x[j, k : k + 31] for j, k in zip(chosen // 51, chosen % 51, strict=True)]),
    )
    assert np.median(predictor.trust.errors) > 5 * np.median(own)


# --- composed lookups


COMPOSED = {**AHEAD, "lift": "polyharmonic", "neighbours": 30, "horizon": 20, "tabulated": 80}


def test_one_lookup_of_the_whole_horizon_is_no_composition(linear):
    once, composed = (eigen_fit(linear, **{**COMPOSED, **how}) for how in ({"tabulated": 60}, {"lookup_steps": 20}))
    x = spread_of(linear)
    same = replace(composed.observables, lookup_steps=None)
    assert composed.observables.future(x) == pytest.approx(same.future(x), abs=0)
    assert once.observables.lookup_steps is None


@pytest.mark.parametrize("steps", [1, 7, 10])
def test_composed_lookups_are_exact_for_a_linear_system(linear, steps):
    """Splines meet every linear function, so that each lookup is exact and with it what follows; 7 leaves a rest."""
    lift = eigen_fit(linear, **COMPOSED, spacing=8, lookup_steps=steps).observables
    x = spread_of(linear)
    truth = np.stack([x @ np.linalg.matrix_power(expm(F * 0.01).T, k) for k in range(21)], axis=1)
    assert lift.future(x) == pytest.approx(truth, abs=1e-7)
    assert len(lift.nodes.kept) == 120 * (81 - steps)


def test_composed_lookups_are_lookups_one_after_another(rolling):
    """In the world: turned back by the heading of every state that is reached."""
    lift = eigen_fit(rolling[0], **COMPOSED, lookup_steps=5, coordinates="world", scale=(1, 0.4, 0.3)).observables
    x = np.asarray(rolling[1].x[:50, 0])
    short = replace(lift, projection=lift.projection[:, :6])
    at = x
    for k in range(0, 20, 5):
        assert lift.future(x)[:, k] == pytest.approx(at, rel=1e-9, abs=1e-12)
        at = short.future(at)[:, 5]


def test_composed_lookups_miss_less(rolling):
    training, test = rolling
    x = np.asarray(test.x)[:, :21]
    errors = []
    for how in ({"tabulated": 60}, {"lookup_steps": 5, "radial_power": 0.2, "scale": (1, 0.4, 0.3)}):
        fit = eigen_fit(training, **{**COMPOSED, **how}, coordinates="world")
        errors.append(rmse(fit.predict(x[:, 0], steps=20), x).mean())
    assert errors[1] < errors[0] / 2


def test_a_composed_lift_is_stored_and_read(rolling):
    fit = eigen_fit(rolling[0], **COMPOSED, lookup_steps=5)
    again = stored.predictor(fit.pack())
    x = np.asarray(rolling[1].x[:9, 0])
    assert (again.observables.lift(x) == fit.observables.lift(x)).all()
    assert "lookup_steps" not in str(eigen_fit(rolling[0], **{**COMPOSED, "tabulated": 60}).pack().meta)


@pytest.mark.parametrize(
    ("how", "text"),
    [
        ({"lookup_steps": 81}, "'fit-eigen.lookup_steps' of 81 is longer than trajectories of 80 steps"),
        ({"scale": (1.0, 2.0), "lookup_steps": 5}, "'fit-eigen.scale' has 2 numbers for 3 states"),
    ],
)
def test_what_does_not_go_with_the_data_is_refused(linear, how, text):
    with pytest.raises(InvalidValueError, match=text):
        eigen_fit(linear, **COMPOSED, **how)
