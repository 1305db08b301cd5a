"""The plant on wheels and vehicle files from the command line."""

from __future__ import annotations

import json

import pytest

from koopcli import load
from koopcli.config.data import data_folder
from tests.cli.test_errors import one_line

FEW = ("--set", "sample.count=30", "--set", "sample.steps=20")


def test_from_a_sample_to_a_verdict(koop):
    """Both fits run on five states, torques and steer, beside baselines."""
    few_tests = ("--set", "test.count=20", "--set", "test.steps=10")
    trajectories = koop("simulate", "--plant", "wheels", *FEW)
    assert "substeps at most: 2 to" in trajectories.err
    for fit in (("--basis", "total", "--order", "2"), ("--basis", "thin-plate"), ("--basis", "states")):
        predictor = koop("fit-edmd", trajectories.name, *fit)
        assert predictor.code == 0, predictor.err
        scored = koop("evaluate", predictor.name, *few_tests, "--json")
        assert scored.code == 0, scored.err
        found = json.loads(scored.out)
        assert found["trajectories"] == 20
        assert set(found["baselines"]) == {"hold", "linearisation", "linear"}
        assert found["max_error"].keys() == {"v_x", "v_y", "yaw_rate", "wheel_rate_f", "wheel_rate_r"}
    coasting = (*FEW, "--set", "simulate.plant=wheels", "--set", "sample.excitation=none")
    eigen = koop(
        "fit-eigen", *coasting, "--boundary", "optimal", "--degree", "1", "--tabulate", "0.1", "--mirror", "left-right"
    )
    assert eigen.code == 0, eigen.err
    assert koop("evaluate", eigen.name, "--excitation", "none", *few_tests).code == 0
    one_line(koop("fit-eigen", "--set", "simulate.plant=wheels"), 3, "sample.excitation=none")
    refused = koop("fit-eigen", *coasting, "--degree", "1", "--tabulate", "0.1", "--mirror", "front-rear")
    one_line(refused, 3, "changes more than the sign of wheel_rate_f, wheel_rate_r")


def test_the_reference_says_how_far_the_usual_integration_is_off(koop):
    found = koop(
        "simulate", "--plant", "wheels", "--reference", "--set", "sample.count=2", "--set", "sample.steps=3", "--json"
    )
    assert found.code == 0, found.err
    told = json.loads(found.out)
    assert told["substeps"]["max"] == 0  # the solver's own
    assert 0 < told["difference"]["v_x"]["max"] < 1e-3
    assert told["difference"]["wheel_rate_r"]["unit"] == "rad/s"
    usual = load(told["compared"])
    assert usual.course.substeps.min() >= 1
    plain = koop("simulate", "--plant", "wheels", "--set", "sample.count=2", "--set", "sample.steps=3")
    assert plain.name == told["compared"]


def test_manoeuvres(koop, folder):
    sample = koop("sample", "manoeuvre", "step-steer", "--vehicle", "bmw-320i", "--scale", "0.5")
    assert sample.code == 0, sample.err
    trajectory = koop("simulate", sample.name, "--vehicle", "bmw-320i")
    assert "1 trajectories × 400 steps" in trajectory.err
    drawn = koop("plot", "trajectory", trajectory.name, "-o", "path.pdf", "--csv", "path.csv")
    assert drawn.code == 0, drawn.err
    assert (folder / "path.pdf").stat().st_size > 1000
    assert (folder / "path.csv").read_text().startswith("time (s),X (m),Y (m)")
    one_line(koop("plot", "trajectory", trajectory.name, "--set", "plot.trajectory=1"), 3, "counted from 0 to 0")
    other = ("--set", "sample.kind=manoeuvre", "--set", "sample.name=brake-in-turn", "--dry-run")
    assert "name=brake-in-turn" in koop("plot", "trajectory", *other).out
    one_line(koop("sample", "manoeuvre", "moose"), 2, "moose")
    one_line(koop("sample", "manoeuvre", "--set", "vehicle.mu_scale=0"), 3, "no steer turns a car without grip")
    one_line(koop("sample", "drive", "step-steer"), 2, "'sample.name' belongs to sample 'manoeuvre'")
    one_line(koop("sample", "manoeuvre", "--speed", "-3"), 3, "'sample.speed' must be above 0 m/s")
    one_line(koop("simulate", sample.name, "--dt", "0.02"), 3, "every 0.01 s", "--set simulate.dt=0.02")
    slower = koop("sample", "manoeuvre", "--set", "simulate.dt=0.02")
    assert koop("simulate", slower.name, "--dt", "0.02", "--dry-run").code == 0
    one_line(koop("simulate", sample.name, "--steps", "500"), 3, "400 steps")


@pytest.mark.parametrize(
    ("options", "code", "parts"),
    [
        (("--set", "sample.slowest=40"), 3, ("'sample.slowest' 40 m/s must not be above 'sample.fastest' 30 m/s",)),
        (("--set", "sample.torque=-1"), 3, ("'sample.torque' must be at least 0 N m",)),
        (("--combined", "square"), 2, ("square",)),
        (("--force-per", "wheel"), 2, ("belongs to plant 'forces', and this plant is 'wheels'",)),
        (("--set", "simulate.v_eps=0"), 3, ("'simulate.v_eps' must be above 0 m/s",)),
        (("--set", "sample.torque=nan"), 3, ("'sample.torque' must be a finite number",)),
        (("--set", "sample.excitation=none", "--set", "sample.steer=0.1"), 2, ("'none' has no use for it",)),
    ],
)
def test_wrong_settings_of_wheels(koop, options, code, parts):
    one_line(koop("simulate", "--plant", "wheels", *options), code, *parts)


def test_options_of_other_plants_are_refused(koop):
    one_line(koop("simulate", "--combined", "ellipse"), 2, "the plant 'forces' has no use for it")
    one_line(
        koop("simulate", "--plant", "slips", "--set", "simulate.brake_width=2"),
        2,
        "and this plant is 'slips'",
    )
    one_line(koop("simulate", koop("sample", "box").name, "--plant", "wheels"), 3, "drive or drive-test or manoeuvre")


@pytest.mark.slow  # what ends early took many steps before
def test_a_diverging_trajectory_is_data(koop):
    """Some end early: they are told, kept up to their end, and left out of fits and scores."""
    wild = ("--set", "sample.count=20", "--set", "sample.steps=5", "--set", "simulate.v_eps=1e-9")
    found = koop("simulate", "--plant", "wheels", *wild, "--set", "sample.slowest=-0.2", "--json")
    assert found.code == 0, found.err
    told = json.loads(found.out)
    (ended,) = told["ended"].values()
    assert 0 < ended < 10
    assert f"{ended} of 20 needed too many integration steps for one sample, the first is number" in found.err
    data = load(told["name"])
    assert (~data.course.finished).sum() == ended
    assert (data.course.steps[~data.course.finished] < 5).all()
    fitted = koop("fit-edmd", told["name"], "--basis", "total", "--order", "1")
    assert f"{ended} of 20 trajectories ended early and are left out" in fitted.err
    scored = koop("evaluate", fitted.name, "--on", told["name"], "--json")
    assert json.loads(scored.out)["trajectories"] == 20 - ended
    scored = koop("plot", "horizon", json.loads(scored.out)["name"])
    assert scored.code == 0, scored.err


def test_a_vehicle_without_wheels(koop, folder):
    text = (data_folder() / "vehicles" / "ctu-2020.toml").read_text()
    bare = "\n".join(line for line in text.splitlines() if not line.startswith(("J_R", "r_w")))
    (folder / "bare.toml").write_text(bare)
    one_line(koop("simulate", "--plant", "wheels", "--vehicle", "bare.toml"), 3, "radius r_w")
    one_line(koop("sample", "manoeuvre", "--vehicle", "bare.toml"), 3, "inertia J_R and radius r_w")
    checked = koop("vehicle", "check", "bare.toml", tiny=False)
    assert checked.code == 0
    assert "with the plants forces, slips, axle-forces" in checked.err
    assert "no wheels" in checked.err


def test_vehicle_ls_and_show(koop):
    listed = json.loads(koop("vehicle", "ls", "--json", tiny=False).out)
    assert set(listed) == {"bmw-320i", "ctu-2020", "efremov-2020", "rimac-2018"}
    assert "BMW 320i" in koop("vehicle", "ls", tiny=False).out
    shown = koop("vehicle", "show", "efremov-2020", tiny=False)
    for part in (
        "yaw inertia",
        "2688",
        "kg m^2",
        "understeer gradient",
        "0 (neutral)",
        "wheel pole at 1 m/s",
        "source: ",
    ):
        assert part in shown.out
    told = json.loads(koop("vehicle", "show", "bmw-320i", "--json", tiny=False).out)
    assert told["derived"]["substeps at 1 m/s"] == {"value": 128.0, "unit": "1"}
    finer = json.loads(koop("vehicle", "show", "bmw-320i", "--dt", "0.005", "--json", tiny=False).out)
    assert finer["derived"]["substeps at 1 m/s"]["value"] < 128
    one_line(koop("vehicle", "show", "tesla", tiny=False), 4, "unknown vehicle 'tesla'")
    one_line(koop("vehicle", "show", "bmw-320i", "--dt", "0", tiny=False), 3, "--dt must be above 0")


@pytest.mark.parametrize(
    ("old", "new", "parts"),
    [
        ('unit = "kg"', 'unit = "t"', ("'parameters.m' must be given in 'kg', got unit 't'",)),
        ("value = 1300.0", "value = -1.0", ("'parameters.m' must be above 0 kg, got -1",)),
        ("J_R ", "J_X ", ("unknown key 'parameters.J_X'", "J_R")),
        ("[longitudinal]", "[longitudnal]", ("unknown key 'longitudnal'",)),
        ("[lateral]", "[lateral_rear]", ("'lateral_rear' stands beside 'lateral', which is missing",)),
        ('title = "CTU 2020"', "title = 3", ("'title' must be a text, got 3",)),
    ],
)
def test_vehicle_check_says_what_is_wrong(koop, folder, old, new, parts):
    text = (data_folder() / "vehicles" / "ctu-2020.toml").read_text()
    assert old in text
    (folder / "mine.toml").write_text(text.replace(old, new, 1))
    one_line(koop("vehicle", "check", "mine.toml", tiny=False), 3, "mine.toml", *parts)


def test_vehicle_check_of_a_good_file(koop, folder):
    text = (data_folder() / "vehicles" / "efremov-2020.toml").read_text()
    (folder / "mine.toml").write_text(text)
    checked = koop("vehicle", "check", "mine.toml", tiny=False)
    assert checked.code == 0
    assert (
        "mine.toml can be used with the plants forces, slips, axle-forces, wheels; nothing about it is unusual"
        in checked.err
    )
    (folder / "mine.toml").write_text(text.replace("value = 2688.0", "value = 26880.0"))
    assert "is its unit right?" in koop("vehicle", "check", "mine.toml", tiny=False).err
