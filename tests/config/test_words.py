"""Settings that are known by their values alone come back from their words."""

from __future__ import annotations

from dataclasses import replace

import pytest
from koopcli.config.plants import used_of

from koopcli.config.changes import parse_set
from koopcli.config.experiment import load_experiment, vehicle_named
from koopcli.config.settings import Simulate
from koopcli.config.words import plant_words, sample_words, vehicle_words
from koopcli.simulation.samples.ellipsoid import EllipsoidSample
from koopcli.simulation.samples.grid import GridSample
from koopcli.vehicles.parameters import VehicleParameters

CTU, RIMAC, BMW = (vehicle_named(name) for name in ("ctu-2020", "rimac-2018", "bmw-320i"))


def loaded(words):
    return load_experiment("paper", parse_set([f"{name}={value}" for name, value in words.items()]))


@pytest.mark.parametrize("plant", ["forces", "slips", "wheels"])
@pytest.mark.parametrize(
    ("vehicle", "names"),
    [
        (CTU, set()),
        (replace(CTU, m=1234.5678901234567), {"vehicle.m"}),
        (replace(BMW, Jzz=2000.0), {"vehicle.name", "vehicle.Jzz"}),
    ],
)
def test_a_vehicle_comes_back_from_its_words(vehicle, names, plant):
    words = vehicle_words(used_of(vehicle, plant), plant)
    assert set(words) == names
    assert used_of(loaded(words).vehicle, plant) == used_of(vehicle, plant)


def test_single_coefficients_of_a_tyre_are_said():
    odd = replace(RIMAC, lateral=replace(RIMAC.lateral, mu=0.7))
    assert vehicle_words(odd, "slips") == {"vehicle.name": "rimac-2018", "vehicle.lateral.mu": "0.7"}


def test_what_no_words_take_away_is_not_said():
    """Every shipped vehicle has tyres, and --set takes none off."""
    bare = VehicleParameters(m=1.0, Jzz=1.0, l_f=1.0, l_r=1.0, c_w=0.0, A=0.0, rho=0.0)
    assert vehicle_words(bare, "slips") is None
    assert vehicle_words(bare, "forces") is not None


def test_settings_at_their_defaults_are_not_said():
    assert plant_words(Simulate(vehicle=CTU, plant="slips", steps=30).settled()) == {}
    odd = Simulate(vehicle=CTU, plant="slips", dt=0.02, v_eps=0.2).settled()
    words = plant_words(odd)
    assert words == {"simulate.v_eps": "0.2", "simulate.dt": "0.02"}
    again = replace(loaded(words).simulate, plant="slips").settled()
    assert (again.dt, again.v_eps) == (0.02, 0.2)
    grid = GridSample(seed=3, levels=(1.0, 2.5), draw="even")
    words = sample_words(grid, ("seed", "levels", "box"))
    assert loaded({**words, "sample.draw": "even"}).sample("grid") == grid
    assert sample_words(EllipsoidSample(m=1.0, Jzz=1.0, energy=4e5), ("energy",)) == {"sample.energy": "400000"}
