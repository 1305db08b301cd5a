"""Settings that are known by their values alone come back from their words."""

from __future__ import annotations

from dataclasses import replace

import pytest

from koopcli.config.changes import parse_set
from koopcli.config.experiment import load_experiment
from koopcli.config.settings import Simulate
from koopcli.config.shipped import vehicle_named
from koopcli.config.words import plant_words, sample_words, vehicle_words
from koopcli.simulation.samples.ellipsoid import EllipsoidSample
from koopcli.simulation.samples.grid import GridSample
from koopcli.vehicles.parameters import VehicleParameters
from koopcli.vehicles.plants.forces import Forces
from koopcli.vehicles.plants.slips import Slips
from koopcli.vehicles.plants.wheels import Wheels

CTU, RIMAC, BMW = (vehicle_named(name) for name in ("ctu-2020", "rimac-2018", "bmw-320i"))


def loaded(words):
    return load_experiment("paper", parse_set([f"{name}={value}" for name, value in words.items()]))


@pytest.mark.parametrize("plant", [Forces(), Slips(), Wheels()])
@pytest.mark.parametrize(
    ("vehicle", "names"),
    [
        (CTU, set()),
        (replace(CTU, m=1234.5678901234567), {"vehicle.m"}),
        (replace(BMW, Jzz=2000.0), {"vehicle.name", "vehicle.Jzz"}),
    ],
)
def test_a_vehicle_comes_back_from_its_words(vehicle, names, plant):
    words = vehicle_words(plant.used(vehicle), plant)
    assert set(words) == names
    assert plant.used(loaded(words).vehicle) == plant.used(vehicle)


def test_single_coefficients_of_a_tyre_are_said():
    odd = replace(RIMAC, lateral=replace(RIMAC.lateral, mu=0.7))
    assert vehicle_words(odd, Slips()) == {"vehicle.name": "rimac-2018", "vehicle.lateral.mu": "0.7"}


def test_what_no_words_take_away_is_not_said():
    """Every shipped vehicle has tyres, and --set takes none off."""
    bare = VehicleParameters(m=1.0, Jzz=1.0, l_f=1.0, l_r=1.0, c_w=0.0, A=0.0, rho=0.0)
    assert vehicle_words(bare, Slips()) is None
    assert vehicle_words(bare, Forces()) is not None


def test_settings_at_their_defaults_are_not_said():
    assert plant_words(Simulate(vehicle=CTU).settled(Slips(), 30)) == {}
    odd = Simulate(vehicle=CTU, dt=0.02).settled(Slips(v_eps=0.2), 30)
    words = plant_words(odd)
    assert words == {"simulate.v_eps": "0.2", "simulate.dt": "0.02"}
    again = loaded(words)
    assert (again.simulate.dt, again.plant_for(Slips)) == (0.02, Slips(v_eps=0.2))
    grid = GridSample(seed=3, levels=(1.0, 2.5), draw="even")
    words = sample_words(grid, ("seed", "levels", "box"))
    assert loaded({**words, "sample.draw": "even"}).sample("grid") == grid
    assert sample_words(EllipsoidSample(m=1.0, Jzz=1.0, energy=4e5), ("energy",)) == {"sample.energy": "400000"}
