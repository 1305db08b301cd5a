"""What is said of a vehicle: values of another unit, and another vehicle that makes the same."""

from __future__ import annotations

import pytest

from koopcli.config.changes import parse_set
from koopcli.config.data import data_folder
from koopcli.config.experiment import load_experiment
from koopcli.stages import recipes
from koopcli.stages.pipeline import Pipeline
from koopcli.stages.vehicle import makes_the_same
from koopcli.store import Store
from tests.stages.test_pipeline import Listener


def experiment(*settings, base="paper"):
    return load_experiment(base, parse_set(settings))


def warned(tmp_path, *tasks):
    heard = Listener()
    line = Pipeline(Store(tmp_path), heard)
    for task in tasks:
        line.plan(task)
    return heard.warnings


GRAMS = "m is 1.3 kg; road vehicles have 300 to 40000: is its unit right?"


@pytest.mark.parametrize(
    ("make", "settings", "said"),
    [
        (lambda e: recipes.sample(e.sample("grid")), ["vehicle.m=1.3"], []),  # no vehicle is behind it
        (lambda e: recipes.sample(e.sample("ball")), ["vehicle.m=1.3"], [GRAMS]),
        (lambda e: recipes.sample(e.sample("drive")), ["vehicle.r_w=330"], ["r_w is 330 m"]),
        (lambda e: recipes.sample(e.sample("greedy")), ["vehicle.m=1.3"], [GRAMS, "Jzz over m l_f l_r is 571.7"]),
        (recipes.simulation, ["vehicle.l_f=1372", "vehicle.l_r=1372"], ["wheelbase is 2744 m", "Jzz over m l_f l_r"]),
        (recipes.fit_edmd, ["vehicle.r_w=330"], []),  # no wheel turns in it
        (recipes.evaluation, ["vehicle.m=1.3"], [GRAMS, "Jzz over m l_f l_r is 571.7"]),
        (recipes.fit_eigen, ["vehicle.mu_scale=3"], []),  # a grip has no unit
    ],
)
def test_a_value_of_another_unit_is_said_once(tmp_path, make, settings, said):
    task = make(experiment(*settings))
    heard = warned(tmp_path, task, task)
    assert len(heard) == len(said)
    assert all(text.startswith(start) for text, start in zip(heard, said, strict=True))


def test_no_shipped_vehicle_is_odd(tmp_path):
    every = [path.stem for path in (data_folder() / "vehicles").glob("*.toml")]
    fits = [fit(experiment(f"vehicle.name={name}")) for name in every for fit in (recipes.fit_edmd, recipes.fit_eigen)]
    assert not warned(tmp_path, *fits)


def test_a_figure_that_draws_no_vehicle_says_so(koop, folder):
    assert "draws nothing of rimac-2018" in koop("plot", "single-track", "--set", "vehicle.name=rimac-2018").err
    assert "draws nothing" not in koop("plot", "tyre", "--set", "vehicle.name=rimac-2018", "--dry-run").err


def test_another_vehicle_that_makes_the_same_is_named():
    rimac = experiment("vehicle.name=rimac-2018")
    assert recipes.fit_edmd(rimac) == recipes.fit_edmd(experiment())
    assert makes_the_same(rimac, [recipes.fit_edmd(rimac)]) == (
        "rimac-2018 and ctu-2020 differ only in lateral, longitudinal, which the plant 'forces' does not use: what is "
        "made is the same"
    )
    states = recipes.sample(rimac.sample("ball"))
    assert "which a sample of kind 'ball' does not use" in makes_the_same(rimac, [states])


def test_a_vehicle_of_an_experiment_file_is_one_that_was_named(tmp_path):
    (tmp_path / "mine.toml").write_text('[vehicle]\nname = "rimac-2018"\n')
    mine = experiment(base=str(tmp_path / "mine.toml"))
    assert "rimac-2018 and ctu-2020 differ only in lateral" in makes_the_same(mine, [recipes.fit_edmd(mine)])
    back = experiment("vehicle.name=ctu-2020", base=str(tmp_path / "mine.toml"))
    assert "ctu-2020 and rimac-2018 differ only in lateral" in makes_the_same(back, [recipes.fit_edmd(back)])


def test_a_copy_has_the_same_parameters(tmp_path):
    (tmp_path / "copy.toml").write_text((data_folder() / "vehicles" / "ctu-2020.toml").read_text())
    copy = experiment(f"vehicle.name={tmp_path / 'copy.toml'}")
    assert "copy and ctu-2020 have the same parameters" in makes_the_same(copy, [recipes.fit_eigen(copy)])


@pytest.mark.parametrize(
    ("settings", "make"),
    [
        ([], recipes.fit_edmd),  # none was named but the paper's
        (["vehicle.name=ctu-2020"], recipes.fit_edmd),
        (["vehicle.Jzz=1731"], recipes.fit_edmd),
        (["vehicle.name=bmw-320i"], recipes.fit_edmd),
        (["vehicle.name=rimac-2018"], recipes.fit_eigen),
        (["vehicle.name=rimac-2018"], lambda e: recipes.sample(e.sample("greedy"))),
    ],
)
def test_nothing_is_said_where_the_vehicle_matters(settings, make):
    chosen = experiment(*settings)
    assert makes_the_same(chosen, [make(chosen)]) is None
