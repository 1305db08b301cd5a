from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from koopcli.errors import InvalidValueError
from koopcli.koopman.eigen.recurrence import TOUCH, Surface, _miss, check_recurrence, check_starts
from koopcli.vehicles.plants.slips import SlipInput
from tests.conftest import surface_of, trajectories_of


def surface(plant) -> Surface:
    return Surface(plant.kinetic_energy, lambda x: plant.rhs(x, np.zeros((len(x), 4))))


def circling(turns: float, start: int = 5, samples: int = 60) -> np.ndarray:
    """``start`` trajectories around circles of different heights."""
    angle = 2 * np.pi * turns * np.linspace(0, 1, samples)
    height = np.linspace(0, 1, start)
    return np.stack(
        [np.stack([np.cos(angle), np.sin(angle), np.full(samples, h)], axis=1) for h in height],
    )


@pytest.mark.parametrize("mesh", ["sphere", pytest.param("fibonacci", marks=pytest.mark.slow)])
def test_a_car_that_loses_energy_leaves_its_surface(slips, mesh):
    data = trajectories_of(slips, surface_of(slips, 81, mesh), 150)
    assert check_recurrence(data.x, data.dt, surface(slips))
    assert not check_recurrence(data.x, data.dt)


def test_a_closed_orbit_is_found_with_its_trajectory_and_time():
    with pytest.raises(
        InvalidValueError, match=r"trajectory 0 comes back at 0\.5. s to the initial state of trajector"
    ):
        check_recurrence(circling(1.07), 0.01)
    check_recurrence(circling(0.9), 0.01)


def test_the_way_between_two_samples_counts():
    """No sample is near the start; the way between two of them leads through it."""
    x = np.array([[[0.0, 0, 0], [5, 5, 0], [-1.5, 0, 0], [-0.5, 0, 0], [0.5, 0, 0], [1.5, 0, 0]]])
    with pytest.raises(InvalidValueError, match=r"comes back at 0\.3 s"):
        check_recurrence(x, 0.1)


def test_another_trajectorys_start_counts():
    x = np.array([[[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]], [[2.5, 0, 0], [2.5, 1, 0], [2.5, 2, 0], [2.5, 3, 0]]])
    with pytest.raises(
        InvalidValueError, match=r"trajectory 0 comes back at 0\.2 s to the initial state of trajectory 1"
    ):
        check_recurrence(x, 0.1)


def test_a_start_in_the_middle_of_a_step_is_found_among_others():
    """Starts nearer to the ends of the step than the one that is met do not hide it."""
    x = np.zeros((4, 5, 3))
    x[0, :, 0] = [-10, 0, 10, 20, 30]
    x[1:] = np.array([[15.0, 0, 0], [11, 1, 0], [19, 1, 0]])[:, None] + np.arange(5)[:, None] * [0, 0, 50.0]
    with pytest.raises(
        InvalidValueError, match=r"trajectory 0 comes back at 0\.2 s to the initial state of trajectory 1"
    ):
        check_recurrence(x, 0.1)


def test_the_first_step_counts_too_but_for_its_own_start():
    x = np.zeros((2, 4, 3))
    x[0, :, 0] = [0, 1, 2, 3]
    x[1, :, 0], x[1, :, 2] = 0.5, [0, 5, 10, 15]
    with pytest.raises(InvalidValueError, match=r"trajectory 0 comes back at 0 s to the initial state of trajectory 1"):
        check_recurrence(x, 0.1)
    assert check_recurrence(x[:1], 0.1) is None


def test_a_bent_path_is_followed_between_its_samples():
    """The straight way between two samples of a circle misses the start by more than it may."""
    orbit = circling(1.07, start=1)
    straight = _miss(orbit[:, 1:-1], orbit[:, 2:], orbit[:, :1]) / np.linalg.norm(orbit[:, 2:] - orbit[:, 1:-1], axis=2)
    assert straight.min() > TOUCH
    with pytest.raises(InvalidValueError, match="comes back"):
        check_recurrence(orbit, 0.01)


def test_rest_is_a_return():
    x = np.tile([3.0, 0.0, 0.0], (1, 5, 1))
    with pytest.raises(InvalidValueError, match=r"comes back at 0(\.01)? s"):
        check_recurrence(x, 0.01)


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        ({"c_w": 0.0}, r"trajectory 10 does not leave .* at 0 s, from \[27\.74, 0, 0\]"),  # straight on, for ever
        ({"c_w": 0.0, "mu_scale": 0.0}, "trajectory 0 does not leave"),  # nothing takes energy
        ({"mu_scale": 0.0}, r"trajectory 0 does not leave .* \[0, 0, -26\.73\]"),  # spinning on the spot
    ],
)
def test_a_car_that_keeps_its_energy_is_refused(vehicle, changed, says):
    plant = SlipInput(replace(vehicle, **changed))
    data = trajectories_of(plant, surface_of(plant), 20)
    with pytest.raises(InvalidValueError, match=says):
        check_recurrence(data.x, data.dt, surface(plant))


def test_energy_that_comes_back_later_is_found(sliding):
    data = trajectories_of(sliding, surface_of(sliding), 20)
    x = np.array(data.x)
    x[7, 15] = x[7, 0] * 1.01
    with pytest.raises(InvalidValueError, match=r"trajectory 7 comes back to .* at 0\.15 s"):
        check_recurrence(x, 0.01, surface(sliding))


def shells(plant, factors, counts):
    x0 = np.concatenate([f * surface_of(plant, n, "fibonacci").states for f, n in zip(factors, counts, strict=True)])
    return trajectories_of(plant, replace(surface_of(plant), states=x0, inputs=np.zeros((len(x0), 1, 4))), 60).x


def test_every_shell_is_a_surface_of_its_own(sliding):
    """Trajectories of one may cross another, but none comes back to its own."""
    x = np.array(shells(sliding, (1, 0.5), (25, 16)))
    assert check_recurrence(x, 0.01, surface(sliding)) == 2
    x[30, 20] = x[30, 0] * 1.01
    with pytest.raises(InvalidValueError, match="trajectory 30 comes back to"):
        check_recurrence(x, 0.01, surface(sliding))


def test_states_in_a_volume_are_only_checked_pointwise(sliding):
    x = shells(sliding, np.linspace(0.3, 1, 12), [3] * 12)
    assert check_recurrence(x, 0.01, surface(sliding)) is None


def test_equal_initial_states(sliding):
    data = trajectories_of(sliding, surface_of(sliding, 441), 20)
    assert check_starts(data.x) == 59
    assert check_starts(trajectories_of(sliding, surface_of(sliding, 441, "fibonacci"), 2).x) == 0
    x = np.array(data.x)
    x[20, 5:] += 1e-3
    with pytest.raises(InvalidValueError, match=r"trajectories 0 and 20 start from the same state .* different ways"):
        check_starts(x)
