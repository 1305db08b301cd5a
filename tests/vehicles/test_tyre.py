from __future__ import annotations

import numpy as np
import pytest

from koopcli.vehicles.parameters import MagicFormula
from koopcli.vehicles.tyre import force, slip_angle, stiffness

LOAD = np.array(3000.0)


@pytest.fixture(params=[(8.11, 1.3, 1.95, 0.2), (9.974, 1.28, 0.9689, -1.2446), (10.861, 1.63, 1.0709, 0.5215)])
def tyre(request) -> MagicFormula:
    B, C, mu, E = request.param
    return MagicFormula(B=B, C=C, mu=mu, E=E)


def test_no_slip_no_force_and_odd(tyre):
    slip = np.linspace(-2, 2, 401)
    assert force(tyre, np.zeros(1), LOAD)[0] == 0.0
    assert force(tyre, -slip, LOAD) == pytest.approx(-force(tyre, slip, LOAD), rel=1e-15)


def test_the_slope_at_zero_is_the_stiffness(tyre):
    h = np.array([1e-6])
    slope = (force(tyre, h, LOAD) - force(tyre, -h, LOAD)) / (2 * h)
    assert slope == pytest.approx(stiffness(tyre, LOAD), rel=1e-6)
    assert stiffness(tyre, LOAD) == pytest.approx(tyre.B * tyre.C * tyre.mu * LOAD)


def test_the_peak_is_friction_times_load(tyre):
    """Nowhere above D = μ Fz, and D is reached, since C arctan(…) passes π/2."""
    found = force(tyre, np.linspace(0, 100, 2_000_001), LOAD)
    assert found.max() == pytest.approx(tyre.mu * LOAD, rel=1e-6)
    assert (np.abs(found) <= tyre.mu * LOAD * (1 + 1e-15)).all()


def test_the_slip_angle_in_either_direction_of_travel():
    assert slip_angle(np.array([10.0]), np.array([1.0]), 0.1) == pytest.approx([-np.arctan(0.1)])
    assert slip_angle(np.array([-10.0]), np.array([1.0]), 0.1) == pytest.approx([-np.arctan(0.1)])
    rng = np.random.default_rng(0)
    v_x, v_y = rng.uniform(-30, 30, (2, 1000))
    angle = slip_angle(v_x, v_y, 0.1)
    assert (np.abs(angle) < np.pi / 2).all()
    assert (np.sign(angle) == -np.sign(v_y)).all()  # the force opposes the sliding, whichever way the car goes


def test_the_slip_angle_is_continuous_through_standstill():
    v_x = np.linspace(-0.2, 0.2, 4001)
    angle = slip_angle(v_x, np.full_like(v_x, 0.05), 0.1)
    assert np.abs(np.diff(angle)).max() < 1e-3
    assert slip_angle(np.zeros(1), np.zeros(1), 0.1)[0] == 0.0
