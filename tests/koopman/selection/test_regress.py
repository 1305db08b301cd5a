"""The regression against a plain one, exact recoveries, and the limits of its inputs."""

from __future__ import annotations

import numpy as np
import pytest

from koopcli.errors import InvalidValueError
from koopcli.koopman.selection import regress
from koopcli.koopman.selection.blocks import Piece
from koopcli.koopman.selection.regress import Rung, fit
from koopcli.koopman.selection.windows import ahead_of
from tests.koopman.selection.logs import bilinear, delayed

DT = 0.05
WHOLE = (Piece(0, 1000, 0), Piece(1000, 2400, 0))


def plain(x: np.ndarray, u: np.ndarray, rung: Rung) -> tuple[np.ndarray, np.ndarray]:
    """Gain and constant by ordinary ridge regression, row after row."""
    p = rung.past(DT)
    rows, targets = [], []
    for piece in WHOLE:
        for k in range(piece.start + p, piece.stop - 1):
            row = [*x[k], *u[k]]
            if rung.order == 2:
                row += [x[k, i] * x[k, j] for i in range(2) for j in range(i, 2)]
            for back in range(1, p + 1):
                row += [*x[k - back], *u[k - back]]
            if rung.products:
                row += [u_i * x_j for u_i in u[k] for x_j in x[k]]
            rows.append(row)
            targets.append(x[k + 1] - x[k])
    columns, steps = np.array(rows), np.array(targets)
    mean, spread = columns.mean(axis=0), columns.std(axis=0)
    scaled = (columns - mean) / spread
    gram = scaled.T @ scaled / len(scaled) + rung.ridge * np.eye(scaled.shape[1])
    gain = np.linalg.solve(gram, scaled.T @ (steps - steps.mean(axis=0)) / len(scaled)) / spread[:, None]
    return gain, steps.mean(axis=0) - mean @ gain


@pytest.mark.parametrize("rung", [Rung(0.0), Rung(), Rung(0.1, True), Rung(0.1, True, 2), Rung(0.2, ridge=0.1)])
def test_it_is_ridge_regression_of_the_increment(rung: Rung, monkeypatch: pytest.MonkeyPatch) -> None:
    x, u = bilinear()
    monkeypatch.setattr(regress, "CHUNK", 333)
    fitted = fit(x, u, WHOLE, rung, DT)
    gain, constant = plain(x, u, rung)
    np.testing.assert_allclose(fitted.gain, gain, atol=1e-8)
    np.testing.assert_allclose(fitted.constant, constant, atol=1e-8)


@pytest.mark.parametrize(("make", "rung"), [(delayed, Rung(ridge=0.0)), (bilinear, Rung(0.0, True, ridge=0.0))])
def test_systems_of_its_own_kind_are_recovered(make, rung: Rung) -> None:
    x, u = make()
    starts = np.arange(1100, 1300, 7)
    forecast = fit(x, u, WHOLE[:1], rung, DT)
    wide = regress.Regression(**{**vars(forecast), "low": u.min(axis=0), "high": u.max(axis=0)})
    np.testing.assert_allclose(wide.predict(x, u, starts, 20), ahead_of(x, starts, 20), atol=1e-8)


def test_a_forecast_knows_the_states_up_to_its_start_alone() -> None:
    x, u = delayed()
    fitted, starts = fit(x, u, WHOLE, Rung(), DT), np.array([500])
    forecast = fitted.predict(x, u, starts, 20)
    later = x.copy()
    later[501:] = np.nan
    later[:496] = np.nan
    beyond = u.copy()
    beyond[520:] = np.nan
    np.testing.assert_array_equal(fitted.predict(later, beyond, starts, 20), forecast)


def test_inputs_are_limited_to_what_training_saw() -> None:
    x, u = delayed()
    fitted, starts = fit(x, u, WHOLE, Rung(products=True), DT), np.array([500])
    wild, limited = u.copy(), u.copy()
    wild[500:] = 1e3
    limited[500:] = u.max(axis=0)
    np.testing.assert_array_equal(fitted.predict(x, wild, starts, 20), fitted.predict(x, limited, starts, 20))


def test_constant_columns_are_left_out() -> None:
    x, u = delayed()
    still = np.concatenate([u, np.full((len(u), 1), 0.1)], axis=1)
    forecast = fit(x, still, WHOLE, Rung(), DT).predict(x, still, np.array([500]), 20)
    np.testing.assert_allclose(forecast, fit(x, u, WHOLE, Rung(), DT).predict(x, u, np.array([500]), 20), atol=1e-9)


def test_a_forecast_that_blows_up_stays_a_number() -> None:
    x = np.exp(0.05 * np.arange(100.0))[:, None]
    u = np.zeros((100, 1))
    fitted = fit(x, u, (Piece(0, 100, 0),), Rung(0.0), DT)
    assert np.isfinite(fitted.predict(x, u, np.array([50]), 40)).all()
    unstable = regress.Regression(**{**vars(fitted), "gain": 1e6 * np.ones((2, 1))})
    assert np.isfinite(unstable.predict(x, u, np.array([50]), 40)).all()


def test_no_episode_longer_than_the_memory_is_refused() -> None:
    x, u = delayed()
    with pytest.raises(InvalidValueError, match=r"longer than the memory of 0\.2 s"):
        fit(x, u, (Piece(0, 5, 0), Piece(5, 10, 0)), Rung(), DT)


def test_rungs_that_do_not_exist_are_refused() -> None:
    with pytest.raises(InvalidValueError, match="order 3"):
        Rung(order=3)
    assert [Rung().label, Rung(0.4, True, 2).label] == ["linear, 0.2 s", "products, 0.4 s, degree 2"]
