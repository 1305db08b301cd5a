"""Noise on stored trajectories: its size, its memory, and that it hangs on nothing but its seed and its place."""

from __future__ import annotations

import numpy as np
import pytest

from koopcli.simulation.noise import deviations, measured
from koopcli.vehicles.plants.slips import Slips
from koopcli.vehicles.plants.wheels import Wheels

CALM = np.zeros((300, 101, 3))


def test_a_tenth_of_it_is_on_what_turns():
    assert deviations(0.5, Slips.states) == pytest.approx([0.5, 0.5, 0.05])
    assert deviations(0.5, Wheels.states) == pytest.approx([0.5, 0.5, 0.05, 0.05, 0.05])


@pytest.mark.parametrize("memory", [0.0, 0.8])
def test_it_is_normal_from_the_first_sample_on_and_keeps_its_memory(memory):
    noise = measured(CALM, 0, np.array([2.0, 1.0, 0.5]), 3, memory)
    assert noise.std(axis=(0, 1)) == pytest.approx([2.0, 1.0, 0.5], rel=0.03)
    assert noise[:, 0].std(axis=0) == pytest.approx([2.0, 1.0, 0.5], rel=0.15)
    assert (np.abs(noise[..., 1]) < 1).mean() == pytest.approx(0.683, abs=0.02)  # of a normal number
    assert (noise[:, 1:] * noise[:, :-1]).mean(axis=(0, 1)) == pytest.approx(memory * np.array([4, 1, 0.25]), abs=0.1)
    assert np.abs(np.corrcoef(noise.reshape(-1, 3).T) - np.eye(3)).max() < 0.03


@pytest.mark.parametrize("memory", [0.0, 0.8])
def test_trajectories_drawn_in_parts_have_the_noise_of_the_whole(memory):
    sigma = np.ones(3)
    whole = measured(CALM[:20], 0, sigma, 7, memory)
    parts = [measured(CALM[start : start + 6], start, sigma, 7, memory)[: 20 - start] for start in range(0, 20, 6)]
    assert np.array_equal(np.concatenate(parts), whole)
    assert not np.isclose(whole, measured(CALM[:20], 0, sigma, 8, memory)).any()
