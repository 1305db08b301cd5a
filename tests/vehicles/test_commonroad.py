"""Against a model that nobody here wrote: CommonRoad's single-track drift model with our tyre in it.

Its state has speed and side-slip angle of the body instead of two velocities, its wheels are two to an axle with one
inertia, its slips have the opposite signs and no driving slip; it has no drag.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from koopcli.config.shipped import vehicle_named
from koopcli.vehicles import tyre
from koopcli.vehicles.plants.wheels import TorqueInput

commonroad = pytest.importorskip("vehiclemodels.vehicle_dynamics_std_old")


@pytest.fixture
def theirs(monkeypatch):
    """The right-hand side of CommonRoad for vehicle 2, at most as much of it replaced as the tyre."""
    from vehiclemodels.parameters_vehicle2 import parameters_vehicle2

    p, car = parameters_vehicle2(), vehicle_named("bmw-320i")

    def pure(formula, slip, load):
        return float(tyre.force(formula, np.array([-slip]), load)[0])

    def combined(s, alpha, load):
        parts = [
            np.array([part]) for part in (pure(car.longitudinal, s, load), pure(car.lateral, alpha, load), -s, -alpha)
        ]
        peaks = np.array([car.longitudinal.mu * load]), np.array([car.lateral.mu * load])
        return [float(force[0]) for force in tyre.ellipse(*parts, *peaks)]

    ours = SimpleNamespace(
        formula_longitudinal=lambda s, gamma, load, _: (s, load),
        formula_lateral=lambda alpha, gamma, load, _: ((alpha, load), None),
        formula_longitudinal_comb=lambda s, alpha, at, _: combined(s, alpha, at[1])[0],
        formula_lateral_comb=lambda s, alpha, gamma, mu, load, at, _: combined(s, alpha, load)[1],
    )
    monkeypatch.setattr(commonroad, "tire_model", ours)
    return p


def test_the_parameters_are_theirs(theirs):
    car = vehicle_named("bmw-320i")
    assert (car.m, car.l_f, car.l_r, car.r_w) == pytest.approx((theirs.m, theirs.a, theirs.b, theirs.R_w), rel=1e-4)
    assert (car.Jzz, car.J_R) == pytest.approx((theirs.I_z, theirs.I_y_w / 2), rel=1e-4)


def test_two_hundred_random_states(theirs):
    """Body and wheels within 1e-10, braked and driven, with braking slip on both axles."""
    from dataclasses import replace

    p = theirs
    ours = TorqueInput(
        replace(vehicle_named("bmw-320i"), m=p.m, Jzz=p.I_z, l_f=p.a, l_r=p.b, r_w=p.R_w, J_R=p.I_y_w / 2),
        v_eps=0.1,
        brake_width=0.1,  # theirs is a step
    )
    generator = np.random.default_rng(0)
    for _ in range(200):
        v, beta, r, steer = generator.uniform([3, -0.3, -1, -0.3], [40, 0.3, 1, 0.3])
        v_x, v_y = v * np.cos(beta), v * np.sin(beta)
        along = np.array([v_x * np.cos(steer) + (v_y + p.a * r) * np.sin(steer), v_x])
        rates = along * (1 - generator.uniform(0.0, 0.3, 2)) / p.R_w
        wanted = generator.uniform(-8, 4)
        x = [0.0, 0.0, steer, v, 0.0, r, beta, *rates]
        f = commonroad.vehicle_dynamics_std(list(x), [0.0, wanted], p)
        v_dot, r_dot, beta_dot = f[3], f[5], f[6]
        expected = [
            v_dot * np.cos(beta) - v * np.sin(beta) * beta_dot,
            v_dot * np.sin(beta) + v * np.cos(beta) * beta_dot,
            r_dot,
            f[7],
            f[8],
        ]
        acceleration = commonroad.acceleration_constraints(v, wanted, p.longitudinal)
        torque = p.m * p.R_w * abs(acceleration) / 2  # of both wheels of an axle in theirs
        drives = (torque * p.T_se, torque * (1 - p.T_se)) if acceleration > 0 else (0.0, 0.0)
        brakes = (torque * p.T_sb, torque * (1 - p.T_sb)) if acceleration <= 0 else (0.0, 0.0)
        u = np.array([steer, drives[0], brakes[0], 0.0, drives[1], brakes[1]])
        found = ours.rhs(np.array([v_x, v_y, r, *rates]), u)
        scale = np.abs(expected).max()
        assert found == pytest.approx(expected, rel=1e-10, abs=1e-10 * scale)
