from __future__ import annotations

import csv
import io
import json
import re

import h5py
import numpy as np
import pytest

import koopcli

NAME = re.compile(r"^(sample|simulate|fit-edmd|evaluate|plot)/[0-9a-f]{12}\n$")


def test_a_stage_named_alone_makes_what_it_needs_and_prints_only_its_name(koop, folder):
    first = koop("fit-edmd", "--order", "2")
    assert first.code == 0
    assert NAME.match(first.out)
    where, *lines = first.err.splitlines()
    assert where == "store: artefacts"
    assert [line.split("/")[0] for line in lines] == ["sample", "simulate", "fit-edmd"]
    assert all("made in" in line for line in lines)
    again = koop("fit-edmd", "--order", "2")
    assert again.out == first.out
    assert again.err == f"store: artefacts\n{first.name:<24} reused\n"
    other = koop("fit-edmd", "--order", "1").err.splitlines()[1:]
    assert [(line.split("/")[0], "reused" in line) for line in other] == [("simulate", True), ("fit-edmd", False)]
    assert (folder / "artefacts" / "records" / "fit-edmd").is_dir()


def test_names_pass_from_command_to_command(koop):
    sample = koop("sample", "grid").name
    trajectories = koop("simulate", sample).name
    predictor = koop("fit-edmd", trajectories).name
    evaluation = koop("evaluate", predictor[:16])
    assert evaluation.code == 0
    alone = koop("evaluate")
    assert alone.name == evaluation.name


def test_json_of_a_fit_and_an_evaluation(koop):
    fit = json.loads(koop("fit-edmd", "--json").out)
    assert {"name", "path", "cached", "seconds", "functions", "rank", "condition", "spectral_radius"} <= fit.keys()
    assert fit["functions"] == 27
    assert not fit["cached"]
    scores = json.loads(koop("evaluate", fit["name"], "--json").out)
    for kind in ("rmse", "rmse_printed", "rmse_relift"):
        assert scores[kind].keys() == {"mean", "std", "median", "max"}
    assert (scores["trajectories"], scores["steps"], scores["diverged"]) == (40, 5, 0)
    assert 0 < scores["in_domain_share"] <= 1
    with h5py.File(scores["path"]) as file:
        assert file["rmse"].attrs["units"] == b"%"
        assert scores["rmse"]["mean"] == pytest.approx(file["rmse"][()].mean())
    assert json.loads(koop("evaluate", fit["name"], "--json").out)["cached"]


def test_the_test_set_follows_its_options(koop):
    predictor = koop("fit-edmd").name
    scores = json.loads(
        koop(
            "evaluate", predictor, "--json", "--excitation", "held", "--amplitude", "100", "--count", "7",
            "--steps", "3", "--seed", "1",
        ).out
    )  # fmt: skip
    assert (scores["trajectories"], scores["steps"]) == (7, 3)
    shown = json.loads(koop("show", scores["name"], "--json").out)
    sample = shown["settings"]["trajectories / sample (sample)"]
    assert (sample["excitation"], sample["amplitude"], sample["seed"]) == ("held", 100.0, 1)


def test_a_test_set_by_name(koop):
    sample = koop("sample", "box", "--count", "9", "--excitation", "none").name
    trajectories = koop("simulate", sample, "--steps", "4").name
    scores = json.loads(koop("evaluate", "--on", trajectories, "--json").out)
    assert (scores["trajectories"], scores["steps"]) == (9, 4)


def test_the_plant_of_the_predictor_makes_its_test_set(koop, folder):
    from koopcli.config.data import data_folder

    text = (data_folder() / "vehicles" / "ctu-2020.toml").read_text().replace("1400.0", "1731.0")
    (folder / "mine.toml").write_text(text)
    trajectories = koop("simulate", "--vehicle", "mine.toml", "--force-per", "wheel", "--dt", "0.02").name
    predictor = koop("fit-edmd", trajectories).name
    shown = json.loads(koop("show", koop("evaluate", predictor).name, "--json").out)
    test = shown["settings"]["trajectories (simulate)"]
    assert (test["vehicle"]["Jzz"], test["force_per"], test["dt"]) == (1731.0, "wheel", 0.02)


def test_dry_run_makes_nothing(koop, folder):
    told = koop("evaluate", "--dry-run")
    assert told.code == 0
    assert told.out.count("make") == 12  # six, and six of what the predictor is set beside
    assert "total, roughly" in told.out
    assert "count=40" in told.out
    assert not (folder / "artefacts").exists()
    plan = json.loads(koop("evaluate", "--dry-run", "--json").out)
    assert plan["dry_run"]
    assert len(plan["steps"]) == 12


def test_any_setting_upstream_can_be_set(koop):
    one = koop("evaluate", "--set", "vehicle.Jzz=1731", "--set", "sample.seed=3").name
    shown = json.loads(koop("show", one, "--json").out)
    assert shown["settings"]["predictor / trajectories (simulate)"]["vehicle"]["Jzz"] == 1731.0
    assert shown["settings"]["trajectories (simulate)"]["vehicle"]["Jzz"] == 1731.0
    assert shown["settings"]["predictor / trajectories / sample (sample)"]["seed"] == 3


@pytest.mark.parametrize("command", [("sample", "grid"), ("fit-edmd",)])
def test_naming_a_vehicle_is_never_refused(koop, command):
    """Where it makes the same as another, that is said, and the other's artefact is found."""
    first, *others = (koop(*command, "--vehicle", name, "--dry-run") for name in ("ctu-2020", "rimac-2018"))
    for other in others:
        assert (other.code, other.out) == (0, first.out)
        assert "rimac-2018 and ctu-2020 differ only in lateral, longitudinal" in other.err
    assert "differ only" not in first.err


def test_three_lines_in_a_notebook(koop):
    name = koop("fit-edmd").name
    predictor = koopcli.load(name)
    x = predictor.predict(np.array([20.0, 1.0, 0.5]), np.zeros((10, 4)))
    assert x.shape == (11, 3)
    assert koopcli.load("simulate").x.shape == (5**3 * 8, 2, 3)
    assert koopcli.load("sample").crossed
    assert koopcli.load(koop("evaluate").name).rmse.shape == (40,)


def test_ls_and_show(koop, folder):
    assert koop("ls").code == 0
    name = koop("evaluate").name
    listed = json.loads(koop("ls", "--json").out)
    assert [row["name"].split("/")[0] for row in listed] == [
        "sample", "simulate", "fit-edmd", "sample", "simulate", "evaluate",
        "baseline", "evaluate", "baseline", "evaluate", "fit-edmd", "evaluate",
    ]  # fmt: skip
    assert len(json.loads(koop("ls", "sample", "--json").out)) == 2
    table = koop("ls").out
    assert name in table
    assert "count=40" in table
    shown = koop("show", name).out
    for part in ("rmse.mean", "settings of predictor (fit-edmd)", "vehicle.Jzz", "trajectory, state", "argv"):
        assert part in shown
    rows = list(csv.reader(io.StringIO(koop("show", name, "--csv").out)))
    assert len(rows) == 41
    assert rows[0][0] == "v_x_0 (m/s)"
    path = koop("path", name).name
    assert path.endswith(".h5")
    assert (folder / path).is_file()


def test_pin_and_unpin(koop):
    name = koop("sample").name
    assert koop("pin", name).code == 0
    label = name.replace("/", "-")
    assert [row["pins"] for row in json.loads(koop("ls", "--json").out)] == [[label]]
    assert label in koop("ls").out
    assert koop("unpin", name[:10]).code == 0
    assert [row["pins"] for row in json.loads(koop("ls", "--json").out)] == [[]]
    assert koop("unpin", name).code == 4


def test_a_damaged_pin_can_be_taken_back(koop, folder):
    koop("pin", koop("sample").name)
    for text in ("{", '{"names": 3}', '{"names": [["a"]]}'):
        (folder / "artefacts" / "refs" / "bad.json").write_text(text)
        listed = koop("ls")
        assert listed.code == 0
        assert koop("unpin", "bad").code == 0
    (folder / "artefacts" / "refs" / "odd.json").mkdir()
    assert koop("ls").code == 0


def test_the_horizon_of_a_sample_goes_with_it(koop):
    sample = koop("sample", "box", "--excitation", "held", "--steps", "7", "--count", "3").name
    assert json.loads(koop("simulate", sample, "--json").out)["steps"] == 7


def test_a_predictor_is_tested_without_its_trajectories(koop, folder):
    predictor = koop("fit-edmd", "--set", "vehicle.Jzz=1731").name
    for path in (folder / "artefacts" / "records" / "simulate").iterdir():
        path.unlink()
    shown = json.loads(koop("show", koop("evaluate", predictor).name, "--json").out)
    assert shown["settings"]["trajectories (simulate)"]["vehicle"]["Jzz"] == 1731.0
