from __future__ import annotations

import numpy as np
import pytest

from koopcli.koopman.scores import metrics


def test_by_hand():
    true = np.array([[[3.0, 4.0], [0.0, 5.0]]])
    predicted = true + np.array([[[0.3, 0.4], [0.0, 0.5]]])
    error, size = np.sqrt(0.25 + 0.25), np.sqrt(50)
    assert metrics.rmse(predicted, true) == pytest.approx([100 * error / size])
    assert metrics.rmse_printed(predicted, true) == pytest.approx([100 * error / np.hypot(3, 9)])


def test_the_printed_formula_flatters_the_zero_predictor():
    """The norm of a sum over n equal samples is √n times what it should be: zero scores 100/√n and not 100."""
    true = np.full((1, 25, 3), 2.0)
    zero = np.zeros_like(true)
    assert metrics.rmse(zero, true) == pytest.approx([100])
    assert metrics.rmse_printed(zero, true) == pytest.approx([20])


def test_a_trajectory_of_zeros_has_no_relative_error():
    zero = np.zeros((2, 5, 3))
    assert np.isnan(metrics.rmse(zero + 1, zero)).all()
    assert metrics.summary(metrics.rmse(zero + 1, zero)).keys() == {"mean", "std", "median", "max"}


def test_summary_uses_ddof_zero_and_finite_values():
    s = metrics.summary(np.array([1.0, 3.0, np.nan]))
    assert s == {"mean": 2.0, "std": 1.0, "median": 2.0, "max": 3.0}


def test_diverged_and_in_domain():
    domain = np.array([[-1.0, -1.0], [1.0, 2.0]])
    inside, edge, far = np.zeros((3, 2)), np.array([[0, 0], [1, 2], [1.1, 0]]), np.array([[0, 0], [0, 0], [2e6, 0]])
    x = np.stack([inside, edge, far, np.full((3, 2), np.nan), np.full((3, 2), np.inf)])
    assert metrics.diverged(x, domain).tolist() == [False, False, True, True, True]
    assert metrics.in_domain(x[:3], domain) == pytest.approx([1, 2 / 3, 2 / 3])
