"""The grid: what is interpolated, what is held, and where an episode ends."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from koopcli.logs.derived import causal_mean, heading_rate, restarts_of
from koopcli.logs.resample import (
    Channel,
    between,
    grid_of,
    held_last,
    held_mean,
    interpolated,
    sensible_step,
    silences,
    stretches,
)

TIME = np.arange(0, 4, 0.01)


def channel(time: np.ndarray, values: np.ndarray) -> Channel:
    return Channel(time, values, float(time[-1]))


def test_a_line_is_interpolated_exactly() -> None:
    rng = np.random.default_rng(0)
    time = np.sort(rng.uniform(0, 5, 200))
    grid = grid_of([channel(time, time)], 0.04)
    assert interpolated(grid, channel(time, 3 - 2 * time)) == pytest.approx(3 - 2 * grid, abs=1e-12)


def test_the_mean_of_a_held_value_is_its_integral_over_the_step() -> None:
    time = np.array([0.0, 0.25, 1.0, 1.5])
    values = np.array([1.0, 5.0, -2.0, 7.0])
    means = held_mean(np.array([0.0, 1.0]), Channel(time, values, 2.0), 1.0)
    assert means == pytest.approx([0.25 * 1 + 0.75 * 5, 0.5 * -2 + 0.5 * 7], abs=1e-14)
    assert held_last(np.array([0.0, 0.25, 0.99, 1.6]), Channel(time, values, 2.0), 0.5).tolist() == [1, 5, 5, 7]


@given(st.integers(0, 2**32 - 1))
def test_the_mean_agrees_with_a_fine_sum(seed: int) -> None:
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.integers(1, 30, 40)) / 1000
    values = rng.normal(size=40)
    held = channel(time, values)
    grid = grid_of([held], 0.05)
    fine = grid[:, None] + 0.05 * (np.arange(500) + 0.5) / 500
    direct = values[np.searchsorted(time, fine, side="right") - 1].mean(axis=1)
    assert held_mean(grid, held, 0.05) == pytest.approx(direct, abs=1e-9)


def test_a_value_that_stands_is_exact_and_samples_on_the_grid_are_their_own_means() -> None:
    values = np.sin(TIME)
    grid = grid_of([channel(TIME, values)], 0.01)
    assert len(grid) == len(TIME)
    assert held_mean(grid, channel(TIME, np.full(len(TIME), 0.1)), 0.01).tolist() == [0.1] * len(TIME)
    assert held_mean(grid, channel(TIME, values), 0.01) == pytest.approx(values, abs=1e-13)
    assert held_last(grid, channel(TIME, values), 0.01).tolist() == values.tolist()


def test_nothing_lies_before_the_first_or_after_the_last_sample_of_a_channel() -> None:
    first, second = channel(TIME[10:], TIME[10:]), channel(TIME[:-50], TIME[:-50])
    grid = grid_of([first, second], 0.05)
    assert grid[0] == pytest.approx(TIME[10])
    assert TIME[-51] - 0.05 < grid[-1] <= TIME[-51] + 1e-9
    assert len(grid_of([channel(TIME, TIME), channel(TIME + 100, TIME)], 0.05)) == 0


def test_a_silence_ends_an_episode_only_if_it_is_longer_than_gap_and_than_five_steps() -> None:
    time = TIME[(TIME <= 1) | (TIME > 1.35)]
    begins, ends = silences(time, 0.3)
    assert begins == pytest.approx([1.0])
    assert ends == pytest.approx([1.36])
    assert not len(silences(time, 0.4)[0])
    slow = np.array([0.0, 0.2, 0.4, 0.6, 1.5, 1.7])
    assert not len(silences(slow, 0.3)[0])
    grid = np.arange(0, 3.9, 0.05)
    inside = between(grid, (begins, ends), 0.05)
    assert grid[inside] == pytest.approx(np.arange(1.05, 1.36, 0.05))


def test_stretches_that_are_too_short_are_counted() -> None:
    kept = np.array([1, 1, 1, 0, 1, 0, 0, 1, 1], dtype=bool)
    assert stretches(kept, 2) == ([slice(0, 3), slice(7, 9)], 1)
    assert stretches(np.zeros(4, dtype=bool), 2) == ([], 0)


def test_a_causal_mean_takes_the_past_and_nothing_from_before_a_silence() -> None:
    values = np.array([1.0, 3.0, 5.0, 7.0, 100.0, 102.0])
    restarts = np.array([1, 0, 0, 0, 1, 0], dtype=bool)
    means = causal_mean(values, 3, restarts)
    assert means[2:4].tolist() == [3, 5]
    assert np.isnan(means[[0, 1, 4, 5]]).all()
    assert causal_mean(values, 1, restarts).tolist() == values.tolist()


def test_the_rate_of_a_heading_that_wraps_is_exact_for_a_steady_turn_and_looks_back_only() -> None:
    heading = np.angle(np.exp(1j * (2.0 * TIME + 3)))
    rate = heading_rate(TIME, heading, 0.1, restarts_of(TIME, 0.3))
    assert rate[10:] == pytest.approx(np.full(len(TIME) - 10, 2.0), abs=1e-9)
    assert np.isnan(rate[:10]).all()
    later = heading.copy()
    later[200:] += 0.5
    assert heading_rate(TIME, later, 0.1, restarts_of(TIME, 0.3))[10:200].tolist() == rate[10:200].tolist()


def test_no_rate_is_taken_across_a_silence() -> None:
    time = TIME[(TIME < 1) | (TIME > 2)]
    rate = heading_rate(time, 0.5 * time, 0.1, restarts_of(time, 0.3))
    assert time[np.isnan(rate)] == pytest.approx(np.concatenate([TIME[:10], np.arange(201, 211) / 100]))


@pytest.mark.parametrize(("step", "rounded"), [(0.0398, 0.04), (0.0333, 0.033), (0.01001, 0.01), (0.0249, 0.025)])
def test_a_step_is_rounded_to_what_is_sensible(step: float, rounded: float) -> None:
    assert sensible_step(step) == rounded


def test_a_curve_is_interpolated_with_an_error_of_order_two_in_its_samples() -> None:
    errors = []
    for step in (0.04, 0.02, 0.01):
        time = np.arange(0, 4, step)
        grid = grid_of([channel(time, time)], 0.0317)
        errors.append(np.abs(interpolated(grid, channel(time, np.sin(5 * time))) - np.sin(5 * grid)).max())
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx([2, 2], abs=0.1)
