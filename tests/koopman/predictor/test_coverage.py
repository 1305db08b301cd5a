from __future__ import annotations

import time

import numpy as np
import pytest

from koopcli.koopman.predictor.coverage import Coverage, corners_of, coverage_of
from koopcli.koopman.scores.metrics import overlap_of_largest


def merged(*parts):
    """The corners of states that come part by part."""
    corners = corners_of(parts[0])
    for part in parts[1:]:
        corners = corners_of(np.concatenate([corners, part]))
    return corners


@pytest.fixture
def cloud():
    rng = np.random.default_rng(0)
    states = rng.uniform(-1, 1, (500, 3)) * [30, 20, 5] + [3, -2, 1]
    return states, np.stack([states.min(axis=0), states.max(axis=0)])


def test_distances_in_half_widths_of_the_data(cloud):
    states, domain = cloud
    x = np.random.default_rng(1).uniform(-40, 40, (50, 3))
    half = (domain[1] - domain[0]) / 2
    brute = np.sqrt((((x[:, None] - states) / half) ** 2).sum(axis=2)).min(axis=1)
    coverage = coverage_of(states)
    assert coverage.distance(x) == pytest.approx(brute, rel=1e-9)
    assert coverage.distance(states) == pytest.approx(np.zeros(500), abs=1e-12)


def test_inside_and_outside_the_hull(cloud):
    states, domain = cloud
    coverage = coverage_of(states)
    assert not coverage.outside(states).any()
    centre = states.mean(axis=0)
    mixtures = np.random.default_rng(2).dirichlet(np.ones(500), 100) @ states
    assert not coverage.outside(mixtures).any()
    assert coverage.outside(centre + 1.01 * (states[coverage_extreme(states)] - centre)).all()
    corner = domain[1][np.newaxis]
    assert coverage.outside(corner).all()  # in the box of the data, and yet outside the data


def coverage_extreme(states):
    from scipy.spatial import ConvexHull

    return ConvexHull(states).vertices


def test_a_grid_is_its_box():
    axes = [np.array([-1.0, 0.3, 2.0]), np.array([0.0, 5.0]), np.array([-3.0, -2.0, 4.0])]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    x = np.random.default_rng(6).uniform(-6, 6, (500, 3))
    expected = ((x < grid.min(axis=0)) | (x > grid.max(axis=0))).any(axis=1)
    for states in (grid, grid[:-1]):  # without a corner it is a hull like any other
        coverage = coverage_of(states)
        assert (coverage.outside(x) == expected).all() == (len(states) == len(grid))


@pytest.mark.parametrize("limit", [10, 1 << 16])
def test_a_large_grid_and_a_flat_block_keep_their_corners(limit, monkeypatch):
    from koopcli.koopman.predictor import coverage as module

    monkeypatch.setattr(module, "STATES_LIMIT", limit)
    values = np.linspace(-1, 1, 12)
    grid = np.stack(np.meshgrid(values, values, values), axis=-1).reshape(-1, 3)
    coverage = coverage_of(grid)
    assert not coverage.outside(0.99 * grid).any()
    assert coverage.outside(1.01 * grid[np.abs(grid).max(axis=1) == 1]).all()
    flat = grid[grid[:, 2] == -1]
    both = coverage_of(grid, merged(flat, grid[::7], grid[::5]))
    assert not both.outside(flat).any()


def test_states_in_a_plane_fall_back_to_their_box():
    states = np.random.default_rng(3).uniform(-1, 1, (30, 3)) * [1, 1, 0]
    coverage = coverage_of(states)
    assert not coverage.outside(states).any()
    assert coverage.outside(np.array([[2.0, 0, 0], [0, 0, 3.0]])).all()
    assert np.isfinite(coverage.distance(np.array([[0.0, 0, 3.0]]))).all()


def test_blocks_and_thinning_change_no_hull(cloud, monkeypatch):
    """Every state counts for the hull and the box, however few are kept for distances."""
    from koopcli.koopman.predictor import coverage as module

    states, _ = cloud
    whole = coverage_of(states)
    monkeypatch.setattr(module, "STATES_LIMIT", 100)
    thinned = coverage_of(states, merged(*(states[i : i + 7] for i in range(0, 500, 7))))
    assert len(thinned.states) <= 100
    assert (thinned.domain == whole.domain).all()
    x = np.random.default_rng(5).uniform(-40, 40, (400, 3))
    assert (thinned.outside(x) == whole.outside(x)).all()
    assert not thinned.outside(states).any()


def test_it_survives_storage(cloud):
    coverage = coverage_of(cloud[0])
    again = Coverage.unpack(coverage.pack("m/s, m/s, rad/s"))
    x = np.random.default_rng(4).uniform(-40, 40, (50, 3))
    assert (again.distance(x) == coverage.distance(x)).all()
    assert (again.outside(x) == coverage.outside(x)).all()


def test_the_overlap_of_the_largest():
    values = np.arange(100.0)
    assert overlap_of_largest(values, values) == 1.0
    assert overlap_of_largest(values, -values) == 0.0
    others = values.copy()
    others[[95, 96]] = -1  # of the five largest, two are not large here
    assert overlap_of_largest(values, others) == pytest.approx(0.6)
    values[20:] = np.nan
    assert overlap_of_largest(values, others) == 1.0  # 5 % of twenty is one
    values[5:] = np.nan
    assert overlap_of_largest(values, -others) == 0.0  # never fewer than one
    assert np.isnan(overlap_of_largest(np.full(3, np.nan), np.arange(3.0)))


def test_many_states_have_a_box_at_once():
    """Eight states, whose hull does not end: the box, and the distance as it is; four still have a hull."""
    rng = np.random.default_rng(7)
    states = rng.standard_normal((20_000, 8)) * 10.0 ** np.arange(-4, 4)
    before = time.perf_counter()
    coverage = coverage_of(states)
    assert time.perf_counter() - before < 1.0
    lower, upper = states.min(axis=0), states.max(axis=0)
    assert (coverage.domain == [lower, upper]).all()
    x = rng.standard_normal((500, 8)) * 4 * 10.0 ** np.arange(-4, 4)
    assert (coverage.outside(x) == ((x < lower) | (x > upper)).any(axis=1)).all()
    assert not coverage.outside(states).any()
    assert coverage.distance(states[:50]) == pytest.approx(np.zeros(50), abs=1e-12)
    assert len(merged(states[:10_000], states[10_000:])) <= 16
    assert len(coverage_of(states[:50, :4]).facets) > 8
    assert len(coverage_of(states[:50, :5], most=4).facets) == 10
