from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import RBFInterpolator
from scipy.spatial import Delaunay

from koopcli.errors import InvalidValueError
from koopcli.koopman.eigen.lookup.cloud import Cloud
from koopcli.koopman.eigen.lookup.lookup import Lift, search
from koopcli.koopman.eigen.lookup.nearest import NearestLift
from koopcli.koopman.eigen.lookup.polyharmonic import LARGEST, spline_weights
from koopcli.koopman.eigen.nodes import Search, _first_in_each, nodes_of, thinned

LIFTS = Lift.kinds()


def cloud(places, neighbours=60, spacing=None, trajectories=1):
    j, k = np.divmod(np.arange(len(places)), -(-len(places) // trajectories))
    return Cloud(places, j, k, neighbours, spacing)


@pytest.fixture(scope="module")
def places():
    return np.random.default_rng(0).uniform(-1, 1, (900, 3))


@pytest.fixture(scope="module")
def inside():
    return np.random.default_rng(1).uniform(-0.7, 0.7, (300, 3))


def made(kind, places, **more):
    return LIFTS[kind]().make(cloud(places, LIFTS[kind]().neighbours, **more))


def value(found, values):
    indices, weights = found
    return (weights[..., np.newaxis] * values[indices]).sum(axis=1)


LINEAR = np.array([[1.0, -2.0], [0.5, 3.0], [2.0, 0.1]])


@pytest.mark.parametrize("kind", LIFTS)
def test_weights_add_up_to_one(kind, places, inside):
    _, weights = made(kind, places)(inside)
    assert weights.sum(axis=1) == pytest.approx(np.ones(300), abs=1e-9)


@pytest.mark.parametrize("kind", ["linear", "polyharmonic"])
def test_linear_functions_are_met_exactly(kind, places, inside):
    assert value(made(kind, places)(inside), places @ LINEAR + 7) == pytest.approx(inside @ LINEAR + 7, abs=1e-8)


def test_quadratic_functions_are_met_by_the_spline(places, inside):
    def square(x):
        return np.stack([x[:, 0] * x[:, 1] - x[:, 2] ** 2, 3 * x[:, 2] * x[:, 0] + x[:, 1] ** 2], axis=1)

    assert value(made("polyharmonic", places)(inside), square(places)) == pytest.approx(square(inside), abs=1e-7)


@pytest.mark.parametrize(("kind", "order"), [("nearest", 1), ("linear", 2), ("polyharmonic", 3)])
def test_the_error_falls_with_the_distance_of_the_nodes(kind, order, inside):
    """Nodes on finer and finer grids: an order of convergence each."""

    def wavy(x):
        return np.sin(2 * x[:, :1] + x[:, 1:2]) * np.cos(x[:, 2:])

    errors = []
    for n in (8, 16):
        axis = np.linspace(-1, 1, n)
        grid = np.stack(np.meshgrid(axis, axis, axis), axis=-1).reshape(-1, 3)
        grid = grid + 0.1 / n * np.random.default_rng(2).uniform(-1, 1, grid.shape)
        errors.append(np.sqrt(np.mean((value(made(kind, grid)(inside), wavy(grid)) - wavy(inside)) ** 2)))
    assert np.log(errors[0] / errors[1]) / np.log(15 / 7) > order - 0.25


def test_moving_least_squares_follow_a_trend(places, inside):
    """Not exactly: the slopes are held a little."""
    found = value(made("mls", places)(inside), places @ LINEAR + 7)
    assert np.abs(found - (inside @ LINEAR + 7)).max() < 2e-2
    assert value(made("mls", places)(inside), np.full((900, 1), 7.0)) == pytest.approx(np.full((300, 1), 7.0))


def test_the_walk_finds_the_simplex_that_scipy_finds(places):
    y = np.random.default_rng(3).uniform(-1.1, 1.1, (2000, 3))
    triangulation = Delaunay(places)
    found = triangulation.find_simplex(y)
    T = triangulation.transform[found]
    b = np.einsum("nij,nj->ni", T[:, :3], y - T[:, 3])
    expected = np.column_stack([b, 1 - b.sum(axis=1)])
    indices, weights = made("linear", places)(y)
    hit = found >= 0
    assert 100 < (~hit).sum() < 1900
    values = np.random.default_rng(4).standard_normal((900, 5))
    simplices = triangulation.simplices[found[hit]]
    assert value((indices[hit], weights[hit]), values) == pytest.approx(
        value((simplices, expected[hit]), values), abs=1e-9
    )
    nearest, _ = made("nearest", places)(y[~hit])
    assert (indices[~hit] == nearest).all()  # the stated fallback
    assert (weights[~hit] == [1, 0, 0, 0]).all()


def test_the_walk_among_slivers_and_repeated_nodes():
    """Nodes along curves, many of them twice: thin simplices everywhere."""
    t = np.linspace(0, 1, 60)
    curves = [np.stack([np.cos(a + 0.3 * t), np.sin(a + 0.3 * t), np.full(60, z)], axis=1)
              for a in np.linspace(0, 6, 12) for z in (-1, -0.4, 0.3, 1)]  # fmt: skip
    nodes = np.concatenate([*curves, curves[0], curves[5]])
    y = 0.6 * np.random.default_rng(5).uniform(-1, 1, (1500, 3))
    indices, weights = made("linear", nodes)(y)
    assert weights.min() > -1e-9
    assert (weights[..., np.newaxis] * nodes[indices]).sum(axis=1) == pytest.approx(y, abs=1e-9)


def test_in_two_dimensions_too():
    nodes = np.random.default_rng(6).uniform(-1, 1, (200, 2))
    y = np.random.default_rng(7).uniform(-0.8, 0.8, (100, 2))
    for kind in ("linear", "polyharmonic"):
        assert value(made(kind, nodes)(y), nodes) == pytest.approx(y, abs=1e-8)


def test_the_spline_is_that_of_scipy(places, inside):
    """Its cubic with a quadratic tail on the same neighbours, another implementation."""
    values = np.sin(3 * places[:, :1]) * places[:, 1:2]
    other = RBFInterpolator(places, values, neighbors=60, kernel="cubic", degree=2)(inside)
    assert value(made("polyharmonic", places)(inside), values) == pytest.approx(other, abs=1e-6)


def test_neighbours_that_lie_on_a_line_do_not_make_weights_explode():
    line = np.outer(np.linspace(-1, 1, 60), [1.0, 2.0, -1.0])
    nodes = line + 1e-4 * np.random.default_rng(8).standard_normal((60, 3))
    y = np.array([[0.1, 0.3, -0.1], [0.0, 0.01, 0.0]])
    wild = spline_weights(nodes[np.newaxis] - y[:, np.newaxis], 2, 1e-9)
    assert np.abs(wild).sum(axis=1).max() > 100
    assert np.abs(made("polyharmonic", nodes)(y)[1]).sum(axis=1).max() <= 2 * LARGEST


def test_neighbours_of_one_trajectory_are_apart():
    """Two dense lines and some points: without spacing only one line is seen."""
    t = np.linspace(0, 1, 400)
    near, far = (np.stack([t, np.full(400, off), np.zeros(400)], axis=1) for off in (0.01, 0.2))
    nodes = np.concatenate([near, far])
    y = np.array([[0.5, 0.0, 0.0]])
    plain = cloud(nodes, 20, trajectories=2).near(y)
    assert (plain < 400).all()
    found = np.sort(Cloud(nodes, np.arange(800) // 400, np.arange(800) % 400, 40, 10).near(y)[0])
    steps = np.diff(found[found < 400])
    assert len(steps) > 5
    assert set(steps) <= {10, *range(1, 10)} or (steps % 10 == 0).all()
    first = cloud(nodes, 1, trajectories=2).near(y)[0, 0]
    assert ((found[found < 400] - first) % 10 == 0).sum() >= 10
    assert len(set(found)) == 40


def test_the_nearest_by_brute_force(places, inside):
    distance = np.linalg.norm(inside[:, None] - places, axis=2)
    indices, weights = made("nearest", places)(inside)
    assert (indices[:, 0] == distance.argmin(axis=1)).all()
    assert (weights == 1).all()


@pytest.mark.parametrize("kind", LIFTS)
def test_a_place_that_is_not_finite_has_no_weights(kind, places):
    y = np.array([[0.1, np.nan, 0], [0.2, 0.1, 0.0]])
    indices, weights = search(made(kind, places), y)
    assert np.isnan(weights[0]).all()
    assert weights[1].sum() == pytest.approx(1)
    assert indices.min() >= 0


def test_too_few_nodes_and_nodes_in_a_plane():
    flat = np.random.default_rng(9).uniform(-1, 1, (80, 3)) * [1, 1, 0]
    for kind in ("linear", "mls", "polyharmonic"):
        with pytest.raises(InvalidValueError, match=f"nodes lie in a plane, where the lift '{kind}'"):
            LIFTS[kind]().check(flat)
    NearestLift().check(flat)
    with pytest.raises(InvalidValueError, match=r"'linear' needs 4 nodes and the data have 3"):
        LIFTS["linear"]().check(flat[:3])
    with pytest.raises(InvalidValueError, match=r"needs 60 nodes and the data have 59: .*take fewer neighbours"):
        LIFTS["polyharmonic"]().check(np.random.default_rng(0).standard_normal((59, 3)))
    with pytest.raises(InvalidValueError, match=r"'fit-eigen\.neighbours' must be at least 10 .*, got 7"):
        LIFTS["polyharmonic"](7).check(flat)


def test_thinning_keeps_the_first_of_each_voxel():
    rng = np.random.default_rng(10)
    places = rng.uniform(-1, 1, (5000, 3))
    order = rng.permutation(5000)
    kept = thinned(places, order, 400)
    assert 390 <= len(kept) <= 400
    assert len(np.unique(kept)) == len(kept)
    rank = np.empty(5000, dtype=int)
    rank[order] = np.arange(5000)
    assert rank[kept].mean() < rank.mean()  # early ones are kept
    gaps = np.linalg.norm(places[:, None] - places[kept], axis=2).min(axis=1)
    assert gaps.max() < 0.5  # and nowhere is nothing
    assert (thinned(places, order, 9000) == np.arange(5000)).all()


def test_nodes_know_their_samples():
    x = np.random.default_rng(11).standard_normal((6, 9, 3))
    found = nodes_of(x, 5, Search(NearestLift(), np.ones(3)), 3)
    assert len(found.kept) <= 18
    assert (found.sample < 5).all()
    assert (found.states == x[found.trajectory, found.sample]).all()


def test_a_radial_power_spreads_out_the_middle():
    x = np.array([[4.0, 0, 0], [0, -1.0, 0], [0, 0, 0]])
    found = Search(NearestLift(), np.array([4.0, 4, 4]), power=0.5).place(x)
    assert found == pytest.approx(np.array([[1, 0, 0], [0, -0.5, 0], [0, 0, 0]]))


def test_far_apart_places_are_told_apart():
    """Voxels whose numbers no 64 bits hold: 2³² of them along each axis."""
    far = 2**32 - 1
    voxels = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [1, 0, 0], [far, far, far]])
    assert np.sort(_first_in_each(voxels)).tolist() == [0, 1, 2, 4]


def test_a_spline_is_made_no_simpler_than_it_has_to_be():
    """Nodes close to a plane leave a quadratic open at some places, and a linear tail at some of these, and so on."""
    rng = np.random.default_rng(8)
    nodes = np.column_stack([rng.uniform(-1, 1, (60, 2)), 0.03 * rng.standard_normal(60)])
    y = rng.uniform(-0.3, 0.3, (200, 3))
    indices, weights = made("polyharmonic", nodes)(y)
    near = nodes[indices] - y[:, np.newaxis]
    near /= np.sqrt((near**2).sum(axis=2)).max(axis=1)[:, np.newaxis, np.newaxis]
    left = np.arange(200)
    for degree, softness in ((2, 1e-9), (1, 1e-9), (1, 1e-4), (1, 1e-2)):
        simpler = spline_weights(near[left], degree, softness)
        tame = np.abs(simpler).sum(axis=1) <= 10
        assert tame.sum() > 0
        assert weights[left[tame]] == pytest.approx(simpler[tame], abs=1e-5)
        left = left[~tame]
