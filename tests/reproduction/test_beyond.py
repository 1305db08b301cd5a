"""What a report says of where the error of composed lookups comes from."""

from __future__ import annotations

import numpy as np
import pytest

from koopcli.koopman.scores.metrics import rmse
from koopcli.reproduction.beyond import _parts_of
from tests.conftest import ball_of, eigen_fit, trajectories_of

HOW = {"window": "horizon", "kind": "comb", "pairs": 6, "cut": 1e-10, "lift": "polyharmonic", "neighbours": 30}


@pytest.fixture(scope="module")
def predictor(sliding):
    training = trajectories_of(sliding, ball_of(sliding, 120, 3), 40)
    return eigen_fit(training, **HOW, horizon=20, tabulated=40, lookup_steps=5)


def test_the_floor_is_what_the_modes_hold_of_the_truth(predictor, sliding):
    """And with futures for truth, what the predictor itself says."""
    x = np.asarray(trajectories_of(sliding, ball_of(sliding, 50, 4), 20).x)
    parts = _parts_of(predictor, x)
    assert 0 < parts["floor"] < parts["alone"]
    future = predictor.observables.future(x[:, 0])
    said = predictor.predict(x[:, 0], steps=20)
    assert _parts_of(predictor, future)["floor"] == pytest.approx(rmse(said, future).mean(), rel=1e-6)


def test_shorter_test_trajectories_have_no_floor(predictor, sliding):
    x = np.asarray(trajectories_of(sliding, ball_of(sliding, 50, 4), 12).x)
    assert _parts_of(predictor, x).keys() == {"alone"}
