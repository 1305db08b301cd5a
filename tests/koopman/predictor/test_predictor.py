from __future__ import annotations

import numpy as np
import pytest

from koopcli.errors import InvalidValueError
from koopcli.koopman import stored
from koopcli.koopman.edmd import fit as edmd
from koopcli.koopman.predictor import responses
from koopcli.koopman.predictor.regression import Regression
from tests.conftest import grid_sample, trajectories_of


@pytest.fixture(scope="module")
def predictor(plant):
    data = trajectories_of(plant, grid_sample(count=7, columns=3), 1)
    return edmd.fit(data, edmd.FitEdmd.of(basis="tensor", order=3).basis_from(data))


@pytest.fixture
def start():
    rng = np.random.default_rng(11)
    return rng.uniform(-1, 1, (20, 3)) * [30, 30, 10], rng.uniform(-1e3, 1e3, (20, 12, 4))


def test_the_fast_prediction_equals_the_rolled_one(predictor, start):
    x0, u = start
    z, rolled = predictor.lift(x0), [x0]
    for k in range(12):
        z = z @ predictor.dynamics.A.T + u[:, k] @ predictor.dynamics.B.T
        rolled.append(z @ predictor.C.T)
    rolled[0] = predictor.lift(x0) @ predictor.C.T
    assert predictor.predict(x0, u) == pytest.approx(np.stack(rolled, axis=1), rel=1e-10, abs=1e-10)


@pytest.mark.parametrize("segment", [1, 5, 12, 13])
def test_the_length_of_a_segment_does_not_matter(predictor, start, segment, monkeypatch):
    whole = predictor.predict(*start)
    monkeypatch.setattr(responses, "SEGMENT", segment)
    assert predictor.predict(*start) == pytest.approx(whole, rel=1e-10, abs=1e-10)


def test_an_infinite_condition_survives_storage(predictor):
    from dataclasses import replace

    again = stored.predictor(replace(predictor, regression=Regression(1, 2, np.inf)).pack())
    assert np.isinf(again.regression.condition)


def test_one_trajectory_or_many(predictor, start):
    x0, u = start
    many = predictor.predict(x0, u)
    assert predictor.predict(x0[3], u[3]) == pytest.approx(many[3], rel=1e-12)
    assert predictor.predict(x0.reshape(4, 5, 3), u.reshape(4, 5, 12, 4)).shape == (4, 5, 13, 3)


def test_without_input(predictor, start):
    x0, u = start
    assert predictor.predict(x0, steps=12) == pytest.approx(predictor.predict(x0, 0 * u), rel=1e-14)


def test_a_step_lifts_afresh(predictor, start):
    x0, u = start
    assert predictor.step(x0, u[:, 0]) == pytest.approx(predictor.predict(x0, u[:, :1])[:, 1], rel=1e-10, abs=1e-10)


def test_shapes_that_do_not_fit_are_refused(predictor, start):
    x0, u = start
    for bad in ((x0[:, :2], u), (x0, u[..., :2]), (x0[:3], u), (x0, u[0, 0]), (5.0, u), (x0[0], u[0, 0])):
        with pytest.raises(InvalidValueError, match="do not fit a predictor of 3 states and 4 inputs"):
            predictor.predict(*bad)
    for bad in ({}, {"steps": -1}):
        with pytest.raises(InvalidValueError, match="steps"):
            predictor.predict(x0, **bad)
    assert predictor.predict(x0, steps=0) == pytest.approx(x0[:, np.newaxis], rel=1e-10)
    assert predictor.predict(x0[:0], steps=3).shape == (0, 4, 3)
    with pytest.raises(InvalidValueError, match="do not fit"):
        predictor.predict(x0, u, steps=3)


def test_packed_and_unpacked_it_predicts_the_same(predictor, start):
    again = stored.predictor(predictor.pack())
    assert (again.predict(*start) == predictor.predict(*start)).all()
    assert again.pack().meta == predictor.pack().meta
