from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from koopcli.simulation import designs, sampling


def decaying(x0):
    return x0[:, np.newaxis] * np.exp(-0.1 * np.arange(11.0))[:, np.newaxis]


@pytest.fixture(scope="module")
def candidates():
    return sampling.ball(0, 3000)


def gap(chosen, usable=6, images=()):
    data = decaying(chosen)[:, :usable].reshape(-1, 3)
    data = np.concatenate([data, *(data * one for one in images)])
    return cKDTree(data).query(sampling.ball(1, 4000))[0]


def test_it_fills_the_volume_better_than_chance(candidates):
    chosen = designs.fill(candidates, 100, decaying, 6)
    assert chosen.shape == (100, 3)
    assert len(np.unique(chosen, axis=0)) == 100
    assert gap(chosen).max() < 0.75 * gap(sampling.ball(5, 100)).max()


def test_the_first_states_do_not_depend_on_how_many_follow(candidates):
    more = designs.fill(candidates, 81, decaying, 6)
    assert (designs.fill(candidates, 33, decaying, 6) == more[:33]).all()


def test_a_batch_keeps_apart(candidates):
    """Within one batch nothing is simulated, but states chosen already count."""
    chosen = designs.fill(candidates, 17, decaying, 6)
    apart = np.linalg.norm(chosen[1:, None] - chosen[1:], axis=2) + 9 * np.eye(16)
    assert apart.min() > 0.5


def test_images_count_as_data(candidates):
    mirror = np.array([1.0, -1, -1])
    alone, aware = designs.fill(candidates, 60, decaying, 6), designs.fill(candidates, 60, decaying, 6, [mirror])
    assert gap(aware, images=[mirror]).max() < gap(alone, images=[mirror]).max()


def test_only_usable_samples_count():
    """With one usable sample trajectories cover nothing but their starts."""
    line = np.stack([np.linspace(0.01, 1, 200), np.zeros(200), np.zeros(200)], axis=1)
    near = designs.fill(line, 20, lambda x0: x0[:, np.newaxis] * np.linspace(1, 0, 11)[:, np.newaxis], 1)
    assert np.sort(near[:, 0])[:3].max() < 0.2
    far = designs.fill(line[::-1], 3, lambda x0: x0[:, np.newaxis] * np.linspace(1, 0, 101)[:, np.newaxis], 101)
    assert (far[0] == line[-1]).all()


def test_shells_are_even_and_start_outside():
    points = sampling.fibonacci_mesh(50)
    found = np.linalg.norm(sampling.shells(points, 6), axis=1).reshape(6, 50)
    assert found == pytest.approx(np.tile(np.linspace(1, 0.25, 6)[:, None], 50))
    assert (sampling.shells(points, 1) == points).all()
