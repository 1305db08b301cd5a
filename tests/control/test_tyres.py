"""The forces that a controller knows are those of the plants, and polygons hold all of them."""

from dataclasses import replace

import numpy as np
import pytest

from koopcli.control.attainable import Attainable, directions
from koopcli.control.limits import Limits
from koopcli.control.realise import Inverse
from koopcli.control.tyres import Tyres
from koopcli.errors import InvalidValueError
from koopcli.vehicles.axles import Axles
from koopcli.vehicles.plants.forces import ForceInput
from koopcli.vehicles.plants.slips import SlipInput

STATES = np.array([[20.0, 0, 6], [18, -10, 1.5], [-15, 3, 1], [10, 5, -10], [0.2, 0.1, 0.0], [0, 0, 0]])


def different(p):
    """Another tyre behind, which pulls to one side; half the grip."""
    rear = replace(p.lateral, B=8.0, mu=1.3, S_h=0.02)
    return replace(p, lateral=replace(p.lateral, S_h=-0.01), lateral_rear=rear, mu_scale=0.5, l_r=1.6)


def drawn(n, seed=1):
    g = np.random.default_rng(seed)
    u = g.uniform(-1, 1, (n, 4)) * Limits().bounds
    u[0] = 0
    return u


@pytest.mark.parametrize("combined", ["none", "ellipse"])
@pytest.mark.parametrize("change", [lambda p: p, different])
def test_every_way_to_a_force_finds_that_of_the_plant(rimac, combined, change):
    p = change(rimac)
    tyres, plant = Tyres(p, combined, 0.1), SlipInput(p, 0.1, combined)
    for x in STATES:
        u = drawn(20)
        forces = tyres.forces(x, u)
        body = ForceInput(p).rhs(np.broadcast_to(x, (20, 3)), forces * tyres.scale)
        assert body == pytest.approx(plant.rhs(np.broadcast_to(x, (20, 3)), u), abs=1e-9)
        assert np.array([tyres.at(x, row) for row in u]) == pytest.approx(forces, abs=1e-12)
        grid = tyres.grid(u[:, 0::2, np.newaxis], u[:, 1::2, np.newaxis])
        along, across = tyres.over(np.broadcast_to(x, (20, 3)), grid)
        assert np.stack([along, across], axis=2).reshape(20, 4) == pytest.approx(forces, abs=1e-12)


def test_no_force_is_larger_than_the_largest(tyres):
    u = drawn(2000) * 2
    assert np.hypot(*np.moveaxis(tyres.forces(STATES[0], u).reshape(-1, 2, 2), -1, 0)).max() <= 1 + 1e-12


def test_forces_change_the_body_as_its_matrix_says(tyres, rimac):
    F = np.random.default_rng(0).uniform(-1e4, 1e4, (8, 4))
    x = np.broadcast_to(STATES[1], (8, 3))
    change = ForceInput(rimac).rhs(x, F) - ForceInput(rimac).rhs(x, 0 * F)
    assert change == pytest.approx(F @ tyres.body_matrix.T, abs=1e-10)


def test_a_vehicle_without_grip_is_refused(rimac):
    with pytest.raises(InvalidValueError, match="no grip"):
        Tyres(replace(rimac, mu_scale=0.0))


@pytest.mark.parametrize("combined", ["none", "ellipse"])
def test_the_support_is_the_largest_of_a_fine_grid(rimac, limits, combined):
    """From below, and no more than a tenth of the grip short of it between the few points of the controller."""
    tyres = Tyres(rimac, combined)
    u_now = np.array([0.3, 0.1, -0.5, -0.05])
    of = Attainable(tyres, limits, 6, 0.05)
    x = STATES
    found = of.support(x, u_now)
    axles = Axles(rimac, 1.0, combined)
    assert axles.grip * 2 == pytest.approx(tyres.largest)
    for k in range(6):
        reach = limits.rates * (k * 0.05 + 0.025 + 0.1)
        low, high = np.maximum(u_now - reach, -limits.bounds), np.minimum(u_now + reach, limits.bounds)
        side = np.linspace(0, 1, 121)
        steer, slip = np.meshgrid(side, side, indexing="ij")
        for axle in (0, 1):
            u = np.zeros((side.size**2, 4))
            u[:, 2 * axle] = (low + (high - low) * steer.reshape(-1, 1))[:, 2 * axle]
            u[:, 2 * axle + 1] = (low + (high - low) * slip.reshape(-1, 1))[:, 2 * axle + 1]
            F = tyres.forces(x[k], u)[:, 2 * axle : 2 * axle + 2]
            brute = (F @ directions(12).T).max(axis=0)
            assert (found[k, axle] <= brute + 1e-12).all()
            assert (found[k, axle] >= brute - 0.1).all()


def test_a_finer_grid_of_the_support_comes_to_the_same(tyres, limits):
    """The polygon converges: five times as many points lie within .02 of twenty times as many."""
    u_now = np.zeros(4)
    fine, finer = (
        Attainable(tyres, limits, 6, 0.05, points=points).support(STATES, u_now) for points in ((61, 25), (241, 97))
    )
    assert np.abs(fine - finer).max() < 0.02


def test_rows_and_support_hold_every_force_that_can_be_had(tyres, limits):
    """Rows of the programme in the order of the support: forces of the controller's own grid keep to all of them."""
    of = Attainable(tyres, limits, 6, 0.05)
    upper = of.support(STATES, np.zeros(4)).ravel()
    assert of.rows.shape == (144, 24)
    assert np.abs(of.rows).sum(axis=1).min() > 0.9  # none is zero
    v = np.array([tyres.at(x, np.zeros(4)) for x in STATES])
    assert (of.rows @ v.ravel() <= upper + 1e-12).all()


def test_front_steer_alone_leaves_the_rear_axle_its_own_direction(rimac, tyres):
    x = np.broadcast_to([20.0, 0.0, 0.0], (2, 3))
    s = Attainable(tyres, Limits(steer_rear=0.0), 2, 0.05).support(x, np.zeros(4))
    assert s[:, 1, [3, 9]] == pytest.approx(0, abs=1e-12)  # across the body
    assert s[:, 0, 3].min() > 0.5


@pytest.mark.parametrize("count", [2, 7])
def test_a_number_of_directions_that_makes_no_polygon(tyres, limits, count):
    with pytest.raises(InvalidValueError, match="must be even and at least 4"):
        Attainable(tyres, limits, 2, 0.05, count=count)


@pytest.mark.parametrize("combined", ["none", "ellipse"])
def test_a_force_that_can_be_had_is_given_back(rimac, limits, combined):
    """The penalties on steer and slip alone keep it from being exact: within a fiftieth of the grip, mostly less."""
    tyres = Tyres(rimac, combined)
    inverse = Inverse(tyres, limits)
    errors = []
    for x in STATES[:4]:
        for u in drawn(25, seed=3):
            wanted = tyres.at(x, u)
            found = inverse(x, u, wanted)
            assert (np.abs(found) <= limits.bounds).all()
            errors.append(np.abs(tyres.at(x, found) - wanted).max())
    assert np.median(errors) < 0.01
    assert np.quantile(errors, 0.95) < 0.03


def test_a_force_that_cannot_be_had_costs_no_more_than_a_fine_grid_finds(tyres, limits):
    x, now = STATES[0], np.array([0.1, 0.0, -0.1, 0.0])
    wanted = np.array([0.0, 1.5, -1.5, 0.0])

    def cost(u):
        missed = tyres.at(x, u) - wanted
        return missed @ missed + 1e-3 * (((u - now)[0::2] / 0.6) ** 2).sum() + 2e-3 * ((u[1::2] / 0.15) ** 2).sum()

    found, fine = (cost(Inverse(tyres, limits, points)(x, now, wanted)) for points in ((25, 13), (401, 201)))
    assert found == pytest.approx(fine, abs=0.01)
    assert found > 0.1  # it is missed


def test_clipping_goes_to_the_rates_and_then_to_the_bounds():
    limits = Limits(steer_rear=0.0)
    now = np.array([0.59, 0.0, 0.0, -0.14])
    u = limits.clip(np.array([0.7, 0.15, 0.6, -0.3]), now, 0.01)
    assert u == pytest.approx([0.6, 0.03, 0.0, -0.15])
