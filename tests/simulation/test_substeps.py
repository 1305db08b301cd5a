"""Stiff plants choose their own steps within a sample."""

from __future__ import annotations

import numpy as np
import pytest

from koopcli.simulation import integrate
from koopcli.simulation.integrate import simulate, substeps
from koopcli.vehicles.plants.slips import SlipInput
from tests.conftest import ball_of, surface_of


def finely(x, u, dt):
    return np.full(len(x), 64 * integrate.PER_STEP / dt)


def test_powers_of_two_that_resolve_the_rate():
    rate = np.array([0.0, 100.0, 201.0, 399.0, 401.0, 12_345.0])
    assert substeps(rate, 0.01).tolist() == [1, 1, 2, 2, 4, 64]
    assert np.isinf(substeps(np.array([1e9, np.inf]), 0.01)).all()  # out of reach: the trajectory ends
    assert substeps(np.array([np.nan]), 0.01).tolist() == [1]  # what is lost already is found out later


def test_a_plant_that_is_not_stiff_takes_one_step(plant):
    rng = np.random.default_rng(3)
    x0, u = rng.uniform(-10, 10, (5, 3)), rng.uniform(-1e3, 1e3, (5, 4, 4))
    assert (simulate(plant.rhs, x0, u, 0.01) == simulate(plant.rhs, x0, u, 0.01, fastest_rate=plant.fastest_rate)).all()


@pytest.mark.parametrize(
    ("starts", "count", "steps"),
    [
        (surface_of, 49, 30),
        (ball_of, 150, 10),
        pytest.param(surface_of, 441, 150, marks=pytest.mark.slow),
        pytest.param(ball_of, 500, 50, marks=pytest.mark.slow),
    ],
)
def test_the_chosen_steps_are_near_sixty_four(slips, starts, count, steps):
    sample = starts(slips, count)
    u = np.zeros((sample.starts, steps, 4))
    chosen = simulate(slips.rhs, sample.states, u, 0.01, fastest_rate=slips.fastest_rate)
    fine = simulate(slips.rhs, sample.states, u, 0.01, fastest_rate=finely)
    error = np.sqrt(((chosen - fine) ** 2).sum(axis=(1, 2)) / (fine**2).sum(axis=(1, 2)))
    assert error.max() < 1e-3
    assert error.mean() < 2e-4


def test_one_step_a_sample_would_not_do(sliding):
    """Near standstill the tyres are stiff: what the substeps are for."""
    sample = ball_of(sliding)
    u = np.zeros((sample.starts, 50, 4))
    chosen = simulate(sliding.rhs, sample.states, u, 0.01, fastest_rate=sliding.fastest_rate)
    single = simulate(sliding.rhs, sample.states, u, 0.01)
    error = np.sqrt(((single - chosen) ** 2).sum(axis=(1, 2)) / (chosen**2).sum(axis=(1, 2)))
    assert error.max() > 0.05


def test_rows_choose_for_themselves(sliding, monkeypatch):
    sample = ball_of(sliding, 60)
    u = np.zeros((60, 20, 4))
    together = simulate(sliding.rhs, sample.states, u, 0.01, fastest_rate=sliding.fastest_rate)
    monkeypatch.setattr(integrate, "BATCH", 7)
    apart = simulate(sliding.rhs, sample.states, u, 0.01, fastest_rate=sliding.fastest_rate)
    assert (together == apart).all()


def test_fourth_order_on_tyres(sliding):
    """Halving the step divides the error by sixteen where the tyre is smooth (v_x well above v_eps)."""
    x0 = np.array([[25.0, 2.0, 0.5], [15.0, -3.0, 1.0]])
    u = np.zeros((2, 1, 4))

    def after(n):
        return simulate(sliding.rhs, x0, np.repeat(u, n, axis=1), 0.08 / n)[:, -1]

    exact = after(1024)
    errors = [np.abs(after(n) - exact).max() for n in (8, 16, 32)]
    assert 13 < errors[0] / errors[1] < 20
    assert 13 < errors[1] / errors[2] < 20


@pytest.mark.slow
def test_slower_than_v_eps_stays_finite(vehicle):
    plant = SlipInput(vehicle, v_eps=0.01)
    x0 = np.array([[0.0, 0.0, 0.0], [1e-3, 1e-3, 1e-3], [0.0, 0.5, 0.0]])
    x = simulate(plant.rhs, x0, np.zeros((3, 20, 4)), 0.01, fastest_rate=plant.fastest_rate)
    assert np.isfinite(x).all()
    assert not x[0].any()  # at rest it stays
    assert (np.diff(plant.kinetic_energy(x), axis=1) <= 0).all()


def test_the_rate_is_the_stiffness_of_the_plant(slips):
    """Against the eigenvalues of the Jacobian, where nothing can change and the tyres do not saturate."""
    for v in (0.05, 0.5, 5.0, 30.0):
        x, u = np.array([[v, 0.0, 0.0]]), np.zeros((1, 4))
        J = np.stack([(slips.rhs(x + d, u) - slips.rhs(x - d, u))[0] / 2e-7 for d in 1e-7 * np.eye(3)], axis=1)
        stiffest = np.abs(np.linalg.eigvals(J)).max()
        rate = slips.fastest_rate(x, u, 0.0)[0]
        assert stiffest <= rate <= 2.1 * stiffest


def test_the_rate_covers_what_the_speeds_can_become(slips):
    """Never below the rate of a state reached within the sample, at rest for a moment in a spin above all."""
    sample = ball_of(slips, 300)
    u = np.zeros((300, 5, 4))
    fine = simulate(slips.rhs, sample.states, u, 0.01, fastest_rate=finely)
    foreseen = slips.fastest_rate(fine[:, :-1], u, 0.01)
    later = slips.fastest_rate(fine[:, 1:], u, 0.0)
    now = slips.fastest_rate(fine[:, :-1], u, 0.0)
    assert (foreseen >= 0.999 * np.maximum(now, later)).all()
    assert (slips.fastest_rate(fine[:, :-1], u, 0.0) < foreseen).mean() > 0.5  # the change within a sample counts
