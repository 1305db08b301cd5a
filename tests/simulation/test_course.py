"""How an integration went: what ends a trajectory, what is left of it, and a solver to compare with."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from koopcli.config.shipped import vehicle_named
from koopcli.records import Packed, Trajectories
from koopcli.simulation import integrate as integration
from koopcli.simulation.integrate import LARGEST, LOST, STIFF, integrate, simulate
from koopcli.simulation.reference import difference, reference
from koopcli.vehicles.plants.wheels import TorqueInput


def explode(x, u):
    """Solutions reach infinity at t = 1 / x0."""
    return x**2


@pytest.fixture
def ended() -> Trajectories:
    x0, u = np.array([[0.5], [20.0], [-1.0], [40.0]]), np.zeros((4, 10, 2))
    x, course = integrate(explode, x0, u, 0.01)
    channels = TorqueInput.states
    one = replace_channels(channels, 1)
    return Trajectories(x, u, 0.01, one, replace_channels(channels, 2), (2, 2), {}, course)


def replace_channels(channels, count):
    return replace(channels, names=channels.names[:count], units=channels.units[:count])


def test_an_end_is_recorded_and_the_others_go_on(ended):
    course, x = ended.course, ended.x
    assert course.reason.tolist() == [0, LOST, 0, LOST]
    assert course.steps[1] > course.steps[3] > 0
    for i in range(4):
        assert np.isfinite(x[i, : course.steps[i] + 1]).all()
        assert (np.abs(x[i, : course.steps[i] + 1]) <= LARGEST).all()
        assert np.isnan(x[i, course.steps[i] + 1 :]).all()
    alone = simulate(explode, np.array([[0.5], [-1.0]]), np.zeros((2, 10, 2)), 0.01)
    assert (alone == x[[0, 2]]).all()


def test_what_finished_is_what_fits_see(ended):
    kept = ended.finished()
    assert len(kept) == 2
    assert kept.product is None
    assert (kept.x == ended.x[[0, 2]]).all()
    assert kept.course.finished.all()
    assert kept.finished() is kept


def test_the_course_survives_storage(ended):
    packed = ended.pack()
    again = Trajectories.unpack(Packed(packed.arrays, packed.meta))
    assert (again.course.steps == ended.course.steps).all()
    assert (again.course.reason == ended.course.reason).all()
    unknown = replace(ended, course=None)
    assert Trajectories.unpack(unknown.pack()).course is None
    assert unknown.finished() is unknown


def test_a_row_too_stiff_ends_and_substeps_are_the_most_of_each():
    def rate(x, u, dt):
        return np.where(x[:, 0] > 1.5, np.inf, 700.0 * np.abs(x[:, 0]))

    def rhs(x, u):
        return 10 * np.ones_like(x)

    x, course = integrate(rhs, np.array([[0.1], [1.2]]), np.zeros((2, 9, 1)), 0.01, fastest_rate=rate)
    assert course.reason.tolist() == [0, STIFF]
    assert course.steps.tolist() == [9, 4]
    assert course.substeps.tolist() == [4, 8]
    assert np.isnan(x[1, 5:]).all()


def test_ends_do_not_depend_on_the_batch(monkeypatch):
    x0, u = np.linspace(-30, 60, 40)[:, np.newaxis], np.zeros((40, 10, 1))
    x, course = integrate(explode, x0, u, 0.01)
    monkeypatch.setattr(integration, "BATCH", 7)
    other, again = integrate(explode, x0, u, 0.01)
    assert np.array_equal(x, other, equal_nan=True)
    assert (course.steps == again.steps).all()
    assert 0 < course.finished.sum() < 40


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ctu-2020", "bmw-320i"])
def test_the_reference_solver_agrees(name):
    plant = TorqueInput(vehicle_named(name))
    r_w = plant.parameters.r_w
    x0 = np.array([[v, 0.2, 0.1, v / r_w, 1.05 * v / r_w] for v in (1.0, 5.0, 30.0)])
    u = np.tile([[[0.05, 0, 200.0, 0.01, 100, 0]]], (3, 6, 1))
    u[:, 3:, 0] *= -1
    usual, _ = integrate(plant.rhs, x0, u, 0.01, fastest_rate=plant.fastest_rate)
    seen = []
    exact, course = reference(plant.rhs, x0, u, 0.01, lambda done, total: seen.append((done, total)))
    assert course.finished.all()
    assert seen[-1] == (18, 18)
    assert np.abs(usual - exact)[:, :, :3].max() < 1e-3
    fine, _ = integrate(plant.rhs, x0, u, 0.01, fastest_rate=lambda *now: 8 * plant.fastest_rate(*now))
    assert np.abs(fine - exact)[:, :, :3].max() < 2e-6


def test_the_reference_solver_ends_trajectories_too():
    x, course = reference(explode, np.array([[0.5], [np.nan], [150.0]]), np.zeros((3, 3, 1)), 0.01)
    assert course.reason[0] == 0
    assert (course.reason[1], course.steps[1]) == (LOST, 0)
    assert course.reason[2] > 0
    assert x[0, -1, 0] == pytest.approx(0.5 / (1 - 0.5 * 0.03), rel=1e-9)


def test_differences_leave_out_what_one_of_both_does_not_have(ended):
    other = replace(ended, x=ended.x + 0.25)
    ((name, _, largest, root),) = difference(other, ended)
    assert name == "v_x"
    assert (largest, root) == pytest.approx((0.25, 0.25), rel=1e-3)
