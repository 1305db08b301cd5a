from __future__ import annotations

import numpy as np
import pytest

from koopcli.errors import InvalidValueError
from koopcli.simulation import sampling
from tests.conftest import surface_of

BOX = (30.0, 30.0, 10.0)


def test_the_grid_is_drawn_in_its_pinned_order():
    factors, u = sampling.grid(5, BOX, 15, "random", (1.0, 5.0, 10.0, 100.0), 15, 4)
    g = np.random.default_rng(5)
    for factor, half_width in zip(factors, BOX, strict=True):
        assert (factor == np.sort(g.uniform(-half_width, half_width, 15))).all()
    for i, level in enumerate((1.0, 5.0, 10.0, 100.0)):
        assert (u[15 * i : 15 * (i + 1), 0] == g.uniform(-level, level, (15, 4))).all()
    assert u.shape == (60, 1, 4)


def test_even_values_take_nothing_from_the_generator():
    factors, u = sampling.grid(5, BOX, 15, "even", (1.0,), 15, 4)
    assert (factors[2] == np.linspace(-10, 10, 15)).all()
    assert (u[:, 0] == np.random.default_rng(5).uniform(-1, 1, (15, 4))).all()


@pytest.mark.parametrize(("excitation", "steps"), [("fresh", 30), ("held", 1), ("none", 1)])
def test_the_box_has_the_same_states_whatever_its_inputs(excitation, steps):
    x0, u = sampling.box(7, BOX, 100, excitation, 1e4, 30, 4)
    g = np.random.default_rng(7)
    assert (x0 == g.uniform(-1, 1, (100, 3)) * [30, 30, 10]).all()
    assert u.shape == (100, steps, 4)
    if excitation == "none":
        assert not u.any()
    else:
        assert (u == 1e4 * g.uniform(-1, 1, u.shape)).all()


def test_the_sphere_mesh_of_the_paper():
    points = sampling.sphere_mesh(441)
    assert points.shape == (441, 3)
    assert np.linalg.norm(points, axis=1) == pytest.approx(np.ones(441), rel=1e-15)
    assert len(np.unique(points, axis=0)) == 382  # equal to the last bit: 2 poles and one meridian come again
    assert (points[:21] == [0, 0, -1]).all()
    assert (points[-21:] == [0, 0, 1]).all()
    middle = points.reshape(21, 21, 3)[10]
    angle = np.linspace(0, 2 * np.pi, 21)
    assert middle == pytest.approx(np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1), abs=1e-15)


@pytest.mark.parametrize("count", [4, 15, 441])
def test_the_fibonacci_mesh_is_even(count):
    points = sampling.fibonacci_mesh(count)
    assert np.linalg.norm(points, axis=1) == pytest.approx(np.ones(count), rel=1e-15)
    assert np.abs(points.mean(axis=0)).max() < 1.5 / count
    if count == 441:
        cosine = points @ points.T - 2 * np.eye(count)
        nearest = np.arccos(np.clip(cosine.max(axis=1), -1, 1))
        assert nearest.min() > 0.8 * nearest.max()  # no clusters, unlike a mesh of latitudes


def test_a_mesh_of_latitudes_needs_a_square():
    with pytest.raises(InvalidValueError, match="must be a square such as 441"):
        sampling.check_mesh("sphere", 440)
    sampling.check_mesh("fibonacci", 440)


def test_the_surface_has_one_energy(sliding):
    states = surface_of(sliding, 441).states
    assert sliding.kinetic_energy(states) == pytest.approx(np.full(441, 5e5), rel=1e-14)


def test_the_ball_is_drawn_as_written_down_and_uniform_in_volume():
    generator = np.random.default_rng(3)
    directions = generator.standard_normal((2000, 3))
    radii = generator.random((2000, 1)) ** (1 / 3)
    expected = directions / np.sqrt((directions**2).sum(axis=1, keepdims=True)) * radii
    points = sampling.ball(3, 2000)
    assert points == pytest.approx(expected, rel=1e-15)
    share = (np.linalg.norm(points, axis=1) ** 3).mean()  # uniform in [0, 1]: mean ½, deviation √(1/12 / 2000)
    assert share == pytest.approx(0.5, abs=4 * np.sqrt(1 / 12 / 2000))
