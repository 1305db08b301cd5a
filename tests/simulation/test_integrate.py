from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from koopcli.simulation import integrate
from koopcli.simulation.integrate import simulate


def test_order_four():
    """Halving the step divides the error of a nonlinear pendulum by sixteen."""

    def rhs(x, u):
        return np.stack([x[..., 1], -np.sin(x[..., 0]) + u[..., 0]], axis=-1)

    x0, end = np.array([[1.0, 0.5]]), 2.0
    errors = []
    exact = simulate(rhs, x0, np.full((1, 4096, 1), 0.3), end / 4096)[0, -1]
    for steps in (16, 32, 64, 128):
        x = simulate(rhs, x0, np.full((1, steps, 1), 0.3), end / steps)
        errors.append(np.abs(x[0, -1] - exact).max())
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders == pytest.approx([4, 4, 4], abs=0.25)


def test_against_an_adaptive_solver(plant):
    x0, u = np.array([20.0, -3.0, 4.0]), np.array([500.0, 900.0, -200.0, 300.0])
    ours = simulate(plant.rhs, x0[None], np.tile(u, (1, 300, 1)), 0.001)[0, -1]
    reference = solve_ivp(lambda t, x: plant.rhs(x, u), (0, 0.3), x0, rtol=1e-12, atol=1e-12, method="DOP853")
    assert ours == pytest.approx(reference.y[:, -1], rel=1e-9)


def test_the_input_acts_from_its_own_sample_on():
    x = simulate(lambda x, u: u, np.zeros((1, 1)), np.array([[[1.0], [0.0], [2.0]]]), 0.5)
    assert x[0, :, 0] == pytest.approx([0, 0.5, 0.5, 1.5])


def test_rows_do_not_depend_on_their_batch(plant, monkeypatch):
    rng = np.random.default_rng(3)
    x0, u = rng.uniform(-10, 10, (50, 3)), rng.uniform(-1e3, 1e3, (50, 4, 4))
    whole = simulate(plant.rhs, x0, u, 0.01)
    monkeypatch.setattr(integrate, "BATCH", 7)
    seen = []
    assert (simulate(plant.rhs, x0, u, 0.01, lambda done, total: seen.append((done, total))) == whole).all()
    assert seen[-1] == (200, 200)
    assert len(seen) == 8 * 4
