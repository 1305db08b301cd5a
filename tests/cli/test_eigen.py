"""The eigenfunction method from the command line: what is made, what is refused, what is said."""

from __future__ import annotations

import csv
import io
import json

import numpy as np
import pytest

import koopcli
from tests.cli.test_errors import one_line


def figures(result):
    assert result.code == 0, result.err
    return json.loads(result.out)


def test_from_nothing_to_a_score(koop, folder):
    predictor = figures(koop("fit-eigen", "--json"))
    assert predictor["functions"] == 20 * 10
    assert predictor["horizon"] == 10
    assert predictor["spectral_radius"] == pytest.approx(1.0)
    done = koop("evaluate", predictor["name"], "--json")
    scored = figures(done)
    assert (scored["trajectories"], scored["steps"]) == (40, 5)
    assert {"mean", "std", "median", "max"} == set(scored["rmse"]) == set(scored["start_error"])
    assert scored["start_error"]["mean"] > 1  # k = 0 is scored, and is an approximation
    assert "lie outside the data" in done.err
    assert "of the worst 5 % of states" in done.err
    shown = koop("show", scored["name"])
    assert "settings of trajectories / sample (sample)" in shown.out
    table = list(csv.reader(io.StringIO(koop("show", scored["name"], "--csv").out)))
    columns = dict(zip(table[0], np.array(table[1:], dtype=float).T, strict=True))
    assert columns["distance (half-widths)"].min() > 0
    assert columns["start_error (%)"].mean() == pytest.approx(scored["start_error"]["mean"])
    assert columns["outside (1)"].sum() == scored["outside"]


def test_the_same_record_as_edmd_in_a_notebook(koop, folder):
    name = koop("fit-eigen").name
    predictor = koopcli.load(name)
    assert predictor.predict([20.0, 1.0, 0.5], steps=4).shape == (5, 3)
    assert predictor.input_channels.names == ("steer_f", "slip_ratio_f", "steer_r", "slip_ratio_r")


def test_the_plant_names_the_test_set(koop):
    on_slips = koop("evaluate", koop("fit-eigen").name).name
    on_forces = koop("evaluate", koop("fit-edmd").name).name
    for name, plant, kind, first in ((on_slips, "slips", "ball", 0), (on_forces, "forces", "box", 1)):
        settings = figures(koop("show", name, "--json"))["settings"]
        assert settings["trajectories (simulate)"]["plant"] == plant
        assert settings["trajectories / sample (sample)"]["kind"] == kind
        assert settings["evaluate"]["first"] == first


def test_the_test_set_has_the_vehicle_of_the_predictor(koop):
    predictor = koop("fit-eigen", "--vehicle", "rimac-2018", "--set", "vehicle.m=1500").name
    settings = figures(koop("show", koop("evaluate", predictor).name, "--json"))["settings"]
    assert settings["trajectories / sample (sample)"]["m"] == 1500.0
    assert settings["trajectories (simulate)"]["vehicle"]["lateral"]["mu"] == 0.9689


def test_edmd_and_baselines_on_the_very_same_trajectories(koop):
    data = koop("simulate", "--plant", "slips").name
    test = koop("simulate", koop("sample", "ball", "--count", "40").name, "--steps", "5").name
    made = [koop("fit-edmd", data, "--order", "2"), koop("fit-edmd", data, "--basis", "states")]
    made += [koop("baseline", kind, data) for kind in ("hold", "rotation", "linearisation")]
    made += [koop("fit-eigen", data, "--boundary", "optimal")]
    scores = [figures(koop("evaluate", one.name, "--on", test, "--json")) for one in made]
    assert {score["steps"] for score in scores} == {5}
    assert len({score["rmse"]["mean"] for score in scores}) == len(scores)
    assert scores[2]["start_error"]["max"] == 0.0  # hold is exact at k = 0


def test_a_horizon_past_the_window_names_the_longest_allowed(koop, folder):
    predictor = koop("fit-eigen").name
    one_line(koop("evaluate", predictor, "--steps", "11"), 3, "may be asked for 10 at most")
    assert koop("evaluate", predictor, "--steps", "10").code == 0
    test = koop("simulate", koop("sample", "ball").name, "--steps", "12").name
    one_line(koop("evaluate", predictor, "--on", test), 3, "may be asked for 10 at most")


def test_a_table_longer_than_the_data_is_said_as_such(koop, folder):
    one_line(koop("plot", "error-map", "--set", "simulate.steps=15"), 3, "'fit-eigen.tabulate' of 0.2 s leaves nothing")
    assert not (folder / "artefacts").exists()


def test_initial_states_of_several_energies_are_said(koop):
    sample = koop("sample", "ellipsoid").name
    data = koop("simulate", sample, "--set", "vehicle.Jzz=3000").name
    assert "no surface of one kinetic energy" in koop("fit-eigen", data).err
    assert "no surface" not in koop("fit-eigen").err


def test_another_vehicle_than_the_predictors_is_said(koop):
    few = koop("sample", "ball", "--count", "40").name
    test = koop("simulate", few, "--vehicle", "rimac-2018", "--steps", "5").name
    done = koop("evaluate", koop("fit-eigen").name, "--on", test)
    assert "are of another vehicle or plant than the predictor: lateral, longitudinal" in done.err


def test_the_rates_are_shown(koop):
    made = figures(koop("fit-eigen", "--degree", "1", "--json"))
    assert len(made["rates"]) == 4
    assert max(made["rates"]) == 0
    assert made["frequencies"] == [0, 0, 0, 0]
    assert "rates" in koop("show", made["name"]).out


def test_the_horizon_is_checked_before_anything_is_made(koop, folder):
    args = ["plot", "error-map", "--set", "test.ball.steps=11"]
    one_line(koop(*args), 3, "may be asked for 10 at most")
    assert not (folder / "artefacts").exists()


def test_inputs_that_change_are_refused_with_the_reason(koop):
    for kind in ("grid", "box"):
        data = koop("simulate", "--set", f"sample.kind={kind}")
        one_line(koop("fit-eigen", data.name), 3, "belongs to a system that runs by itself")


def test_a_surface_that_trajectories_do_not_leave(koop):
    done = koop("fit-eigen", "--set", "vehicle.c_w=0")
    one_line(done, 3, "trajectory 10 does not leave the surface of equal kinetic energy", "at 0 s")
    done = koop("fit-eigen", "--set", "vehicle.mu_scale=0")
    one_line(done, 3, "trajectory 0 does not leave")


def test_repeated_initial_states_are_said(koop):
    assert "11 of 25 initial states are repeated" in koop("fit-eigen").err
    assert "repeated" not in koop("fit-eigen", "--set", "sample.mesh=fibonacci").err


def test_the_cut_is_said(koop):
    assert "rank 26 of 200 at cut 0.0001" in koop("fit-eigen", "--cut", "1e-4").err
    kept = figures(koop("fit-eigen", "--boundary", "optimal", "--cut", "1e-6", "--json"))
    assert kept["rank"] < kept["directions"] == 10


def test_too_many_substeps(koop):
    some = koop("simulate", "--plant", "slips", "--set", "simulate.v_eps=1e-9")
    assert some.code == 0
    assert "10 of 25 needed too many integration steps" in some.err
    assert "left out of fits and scores" in some.err
    assert koop("fit-eigen", some.name).code == 0
    all_of_them = koop("simulate", "--plant", "slips", "--set", "simulate.v_eps=1e-9", "--set", "sample.energy=1e-9")
    one_line(all_of_them, 3, "no trajectory runs its whole length", "raise simulate.v_eps")


def test_a_vehicle_without_tyres(koop, folder):
    text = (koopcli.config.data.data_folder() / "vehicles" / "ctu-2020.toml").read_text()
    (folder / "bare.toml").write_text(text.partition("[lateral]")[0])
    assert koop("fit-edmd", "--vehicle", "bare.toml").code == 0
    one_line(koop("fit-eigen", "--vehicle", "bare.toml"), 3, "give the vehicle file the tables [lateral]")
    (folder / "odd.toml").write_text(text.replace('mu   = { value = 2.15, unit = "1" }', ""))
    one_line(koop("fit-eigen", "--vehicle", "odd.toml"), 3, "odd.toml", "missing key 'longitudinal.mu'")


def test_a_foreign_test_set(koop):
    forces = koop("simulate", koop("sample", "box").name).name
    one_line(koop("evaluate", koop("fit-eigen").name, "--on", forces), 3, "different states or inputs")
    one_line(koop("evaluate", koop("fit-eigen").name, "--excitation", "held"), 2, "'test.excitation' belongs to test")


@pytest.mark.slow
@pytest.mark.parametrize("figure", ["error-map", "mean-trajectory"])
def test_figures_of_an_evaluation_of_any_method(koop, folder, figure):
    for of in (koop("fit-eigen"), koop("fit-edmd"), koop("baseline", "hold")):
        done = koop("plot", figure, koop("evaluate", of.name).name, "-o", "out.png")
        assert done.code == 0, done.err
        assert (folder / "out.png").read_bytes().startswith(b"\x89PNG")
    one_line(koop("plot", "orders", koop("evaluate", koop("fit-eigen").name).name), 3, "takes evaluations of EDMD")
    two = [koop("evaluate", koop("fit-eigen", "--degree", d).name).name for d in ("1", "2")]
    one_line(koop("plot", figure, *two), 3, "draws one evaluation, got 2")


def test_a_figure_alone_makes_what_it_needs(koop):
    done = koop("plot", "error-map", "--json")
    assert figures(done)["figure"] == "error-map"
    for stage in ("sample", "simulate", "fit-eigen", "evaluate"):
        assert f"\n{stage}/" in f"\n{done.err}"
