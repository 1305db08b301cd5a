from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from koopcli.config.data import data_folder
from koopcli.errors import InvalidValueError
from koopcli.vehicles.parameters import read_vehicle
from koopcli.vehicles.plants.slips import SlipInput
from koopcli.vehicles.symmetry import MIRRORS, images, signs

VEHICLES = sorted((data_folder() / "vehicles").glob("*.toml"))


def f(plant, x):
    return plant.rhs(x, np.zeros((len(x), 4)))


@pytest.fixture(scope="module")
def states():
    return np.random.default_rng(0).uniform(-1, 1, (500, 3)) * [30, 30, 25]


@pytest.mark.parametrize("path", VEHICLES, ids=lambda path: path.stem)
def test_left_and_right_are_alike_in_every_car(path, states):
    plant = SlipInput(read_vehicle(path))
    S = signs("left-right", plant.parameters, plant.states.names)
    assert f(plant, states * S) == pytest.approx(S * f(plant, states), rel=1e-13, abs=1e-12)


def test_front_and_rear_are_alike_where_the_axles_are(vehicle, states):
    plant = SlipInput(vehicle)
    S = signs("front-rear", vehicle, plant.states.names)
    assert f(plant, states * S) == pytest.approx(S * f(plant, states), rel=1e-12, abs=1e-10)


def test_front_and_rear_differ_where_the_axles_do(vehicle, states):
    lopsided = replace(vehicle, l_f=1.2, l_r=1.5)
    plant = SlipInput(lopsided)
    S = np.array([MIRRORS["front-rear"][state] for state in plant.states.names])
    assert np.abs(f(plant, states * S) - S * f(plant, states)).max() > 0.1
    with pytest.raises(InvalidValueError, match=r"no front-rear symmetry: .*l_f 1\.2 m, l_r 1\.5 m"):
        signs("front-rear", lopsided, plant.states.names)


def test_images_of_both_mirrors_are_three(vehicle):
    found = images(("left-right", "front-rear"), vehicle, SlipInput.states.names)
    assert {tuple(one) for one in found} == {(1, -1, -1), (-1, 1, -1), (-1, -1, 1)}
    assert images((), vehicle, SlipInput.states.names) == []
