"""Predictors with a memory: what they start from, and inputs that they are limited to."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from koopcli.errors import InvalidValueError
from koopcli.koopman.bases.polynomial import Total
from koopcli.koopman.edmd.increments import fit_increments
from tests.koopman.edmd.delayed import Delayed


@pytest.fixture(scope="module", params=[False, True], ids=["linear", "products"])
def predictor(request):
    return fit_increments(Delayed().episodes(), Total(1), 3, request.param)


@pytest.fixture
def start():
    rng = np.random.default_rng(11)
    inputs = rng.uniform(-0.9, 0.9, (20, 12, 2))
    return rng.uniform(-2, 2, (20, 2)), inputs, (rng.uniform(-2, 2, (20, 3, 2)), rng.uniform(-0.9, 0.9, (20, 3, 2)))


def test_without_a_history_the_start_and_the_first_input_are_repeated(predictor, start):
    x0, u, history = start
    repeated = tuple(np.repeat(values[:, np.newaxis], 3, axis=1) for values in (x0, u[:, 0]))
    assert (predictor.predict(x0, u) == predictor.predict(x0, u, history=repeated)).all()
    assert np.abs(predictor.predict(x0, u) - predictor.predict(x0, u, history=history)).max() > 0.1
    assert predictor.needs_history
    assert (predictor.predict(x0, steps=4) == predictor.predict(x0, 0 * u[:, :4])).all()
    assert predictor.predict(x0, steps=0) == pytest.approx(x0[:, np.newaxis], rel=1e-14)


def test_a_longer_history_is_cut_and_one_of_many_starts_is_as_one_of_one(predictor, start):
    x0, u, history = start
    many = predictor.predict(x0, u, history=history)
    longer = tuple(np.concatenate([past, np.full((20, 4, 2), 1e6)], axis=1) for past in history)
    assert (predictor.predict(x0, u, history=longer) == many).all()
    one = predictor.predict(x0[3], u[3], history=(history[0][3], history[1][3]))
    assert one == pytest.approx(many[3], rel=1e-12)
    grid = predictor.predict(
        x0.reshape(4, 5, 2), u.reshape(4, 5, 12, 2), history=tuple(past.reshape(4, 5, 3, 2) for past in history)
    )
    assert grid.reshape(many.shape) == pytest.approx(many, rel=1e-12)
    without = fit_increments(Delayed().episodes(), Total(1), 0, False)
    assert (without.predict(x0, u, history=history) == without.predict(x0, u)).all()


def test_a_history_that_does_not_fit_is_refused(predictor, start):
    x0, u, (past_x, past_u) = start
    for bad in ((past_x[:, :2], past_u), (past_x, past_u[:, :2]), (past_x[:3], past_u), (past_x[..., :1], past_u),
                (past_x[0], past_u[0])):  # fmt: skip
        with pytest.raises(InvalidValueError, match=r"expected \(20, 3, 2\) and \(20, 3, 2\), newest first"):
            predictor.predict(x0, u, history=bad)


def test_steps_go_from_augmented_states_to_augmented_states(predictor, start):
    x0, u, history = start
    X, seen = predictor.observables.augmented(x0, *history), [x0]
    for k in range(12):
        X = predictor.step(X, u[:, k])
        seen.append(X[:, :2])
    whole = predictor.predict(x0, u, history=history)
    assert np.stack(seen, axis=1) == pytest.approx(whole, rel=1e-10, abs=1e-10)
    assert X[:, 2:8].reshape(20, 3, 2) == pytest.approx(whole[:, [11, 10, 9]], rel=1e-10, abs=1e-10)
    assert (X[:, 8:].reshape(20, 3, 2) == u[:, [11, 10, 9]]).all()
    with pytest.raises(InvalidValueError, match=r"a memory of 3 steps .* of 14 numbers, not of 2"):
        predictor.step(x0, u[:, 0])


def test_the_lift_takes_states_alone_and_augmented_ones(predictor, start):
    x0, _, history = start
    X = predictor.observables.augmented(x0, *history)
    assert (predictor.lift(X) == np.hstack([np.ones((20, 1)), X])).all()
    stood = np.hstack([np.ones((20, 1)), np.tile(x0, 4), np.zeros((20, 6))])
    assert (predictor.lift(x0) == stood).all()
    assert (predictor.lift(x0.reshape(4, 5, 2)) == stood.reshape(4, 5, 15)).all()


def test_inputs_are_limited_to_their_range_in_the_data(predictor, start):
    x0, u, (past_x, past_u) = start
    lower, upper = predictor.limits
    far, past = u.copy(), past_u.copy()
    far[:, 4, 0], far[:3, 5, 1], past[:, 1, 0] = 1e5, -1e5, 1e5
    within, past_within = np.clip(far, lower, upper), np.clip(past, lower, upper)
    limited = predictor.predict(x0, far, history=(past_x, past))
    assert (limited == predictor.predict(x0, within, history=(past_x, past_within))).all()
    free = replace(predictor, limits=None)
    assert (limited == free.predict(x0, within, history=(past_x, past_within))).all()
    assert np.abs(free.predict(x0, far) - limited).max() > 1e3
    X = predictor.observables.augmented(x0, past_x, past_within)
    assert (predictor.step(X, far[:, 4]) == predictor.step(X, within[:, 4])).all()
    assert predictor.limited_share(far) == pytest.approx((20 + 3) / 240)
    assert predictor.limited_share(u) == free.limited_share(far) == predictor.limited_share(u[:0]) == 0.0


def test_what_it_is_in_a_line(predictor):
    assert "15 functions (Memory), steps of 0.1 s, 3 past ones in its lift" in repr(predictor)
