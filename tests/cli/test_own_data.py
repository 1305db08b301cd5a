"""A user's own log from the command line: in, checked, chosen on, scored, predicted, drawn, and what is refused."""

from __future__ import annotations

import csv
import io
import json
import shutil
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import koopcli
from tests.cli.test_errors import one_line

SIMULATED = Path(__file__).parents[2] / "data" / "logs" / "simulated"


def figures(result):
    assert result.code == 0, result.err
    return json.loads(result.out)


@pytest.fixture
def koop(koop):
    """The command line without the small datasets of other tests."""
    return partial(koop, tiny=False)


@pytest.fixture
def bring(koop):
    """Import the simulated log, with changes to its map."""

    def imported(*options, **changes):
        text = (SIMULATED / "map.toml").read_text(encoding="utf-8")
        for before, after in changes.get("swap", {}).items():
            assert before in text
            text = text.replace(before, after)
        Path("map.toml").write_text(text, encoding="utf-8")
        return koop("import", str(SIMULATED), "--map", "map.toml", *options)

    return imported


@pytest.fixture
def log(bring, folder):
    return bring().name


def test_a_mended_log_has_no_alarm(bring, folder):
    done = bring("--json", "--strict")
    told = figures(done)
    assert {"name", "rows", "episodes", "seconds_logged", "states", "inputs", "checks"} <= told.keys()
    assert (told["states"], told["inputs"]) == (["v_x", "yaw_rate"], ["steer", "torque"])
    assert told["episodes"] == 4
    assert {check["verdict"] for check in told["checks"]} <= {"ok", "note"}
    assert all({"name", "value", "verdict"} <= check.keys() for check in told["checks"])
    assert "rows in 4 episodes" in done.err
    log = koopcli.load(told["name"])
    assert log.episodes.x.shape == (told["rows"], 2)


@pytest.mark.parametrize(
    ("swap", "check"),
    [
        ({"sign = -1": "sign = 1"}, "steer_yaw_correlation"),
        ({"offset = -0.2": "offset = 0.0"}, "steer_yaw_lag"),
        ({"ratio = 16.0": "ratio = 1.0"}, "wheelbase"),
        ({'unit = "km/h"': 'unit = "m/s"'}, "wheelbase"),
        ({'unit = "deg/s"': 'unit = "rad/s"'}, "lateral_acceleration"),
    ],
)
def test_each_defect_is_caught_and_stops_a_strict_import_alone(bring, swap, check, folder):
    told = figures(bring("--json", swap=swap))
    caught = {entry["name"]: entry for entry in told["checks"] if entry["verdict"] in ("warn", "ask")}
    assert check in caught
    assert caught[check]["hint"]
    one_line(bring("--strict", swap=swap), 3, "with --strict this log is refused", check)


def test_the_key_is_the_bytes_and_the_map(bring, koop, folder):
    name = bring().name
    shutil.copytree(SIMULATED, "elsewhere")
    shutil.copy(SIMULATED / "map.toml", "another.toml")
    again = koop("import", "elsewhere/motion.csv", "elsewhere/controls.csv", "--map", "another.toml")
    assert again.name == name
    assert "reused" in again.err
    assert bring(swap={"dt = 0.04": "dt = 0.05"}).name != name
    with Path("elsewhere/motion.csv").open("a", encoding="utf-8") as file:
        file.write("\n")
    assert koop("import", "elsewhere", "--map", "another.toml").name != name


def test_a_first_map_imports(koop, folder):
    assert koop("import", str(SIMULATED), "--suggest", "-o", "map.toml").code == 0
    told = figures(koop("import", str(SIMULATED), "--map", "map.toml", "--json"))
    assert {"v_x", "yaw_rate"} <= set(told["states"])
    assert any(check["verdict"] == "ask" for check in told["checks"])  # the sign, which no name tells


def test_from_a_log_to_a_verdict(koop, log, folder):
    done = koop("select", log, "--no-bicycle", "--report", "verdict.html", "--json")
    told = figures(done)
    keys = {"name", "chosen", "verdict", "ratio_to_dmdc", "ratio_to_hold", "per_state", "blocks"}
    assert keys | {"outside_share", "limited_share"} <= told.keys()
    assert told["ratio_to_dmdc"] < 0.9
    assert told["ratio_to_hold"] < 0.3
    assert set(told["per_state"]["yaw_rate"]["0.5"]) == {"rmse", "to_hold", "to_dmdc"}
    assert len(told["blocks"]) == 3
    assert "yaw_rate within" in told["verdict"]
    page = Path("verdict.html").read_text(encoding="utf-8")
    assert told["verdict"].split(";")[0] in page
    assert page.count("data:image/svg+xml") == 3

    scored = koop("evaluate", told["chosen"], "--on", log, "--json")
    assert figures(scored)["fitted_to_it"] is True
    assert "told by koop select" in scored.err
    assert figures(koop("evaluate", told["chosen"], "--json"))["name"] == figures(scored)["name"]  # its own log
    for figure, name in (("log", log), ("skill", told["name"]), ("forecast", figures(scored)["name"])):
        drawn = koop("plot", figure, name, "-o", f"{figure}.svg")
        assert "reused" in drawn.err  # from the report
    again = koop("select", log, "--no-bicycle")
    assert "reused" in again.err
    assert told["chosen"] in again.err


def test_a_longer_ladder_is_said_as_in_a_sweep(koop, log, folder):
    told = koop("select", log, "--no-bicycle", "--set", "fit-edmd.memory=0.2,0.4", "--blocks", "2")
    assert told.code == 0, told.err
    assert "of 4 predictors" in told.err
    one_line(koop("select", log, "--set", "fit-edmd.terms=bilinear"), 3, "must be one of linear, products here")
    one_line(koop("select", log, "--set", "sample.seed=1"), 2, "a ladder has")


def test_a_prediction_has_its_history_and_the_units_of_the_map(koop, log, folder):
    predictor = koop("fit-edmd", log, "--terms", "products").name
    done = koop("predict", predictor, "--from", log, "--at", "3", "--csv", "-")
    header, *rows = csv.reader(io.StringIO(done.out))
    assert header[:3] == ["time (s)", "v_x predicted (km/h)", "yaw_rate predicted (deg/s)"]
    assert header[-2:] == ["steer (deg)", "torque (N m)"]
    table = np.array([[float(cell or "nan") for cell in row] for row in rows])
    assert table[0, 1] == pytest.approx(table[0, 3])  # it starts at what was measured
    assert np.abs(table[:, 1] - table[:, 3]).max() < 3  # km/h
    assert table[0, 0] == pytest.approx(3, abs=0.02)
    alone = koop("predict", predictor, "--x0", "20,0.1", "--seconds", "2")
    assert "no history: as if it had stood so for 0.2 s" in alone.err
    assert "errors are known up to 1 s ahead" in alone.err


def test_inputs_come_from_a_file(koop, log, folder):
    predictor = koop("fit-edmd", log).name
    Path("u.csv").write_text("torque (N m),steer (rad)\n" + "100,0.01\n" * 20, encoding="utf-8")
    told = figures(koop("predict", predictor, "--x0", "15,0", "--inputs", "u.csv", "--json"))
    assert told["steps"] == 20
    assert told["last"]["yaw_rate"] > 0.01
    Path("u.csv").write_text("torque\n100\n", encoding="utf-8")
    one_line(koop("predict", predictor, "--x0", "15,0", "--inputs", "u.csv"), 3, "a header with steer, torque")


def test_inputs_have_the_units_of_their_header(koop, log, folder):
    predictor = koop("fit-edmd", log).name
    last = []
    for header, steer in (("steer (deg)", 0.5), ("steer (rad)", np.radians(0.5)), ("steer", np.radians(0.5))):
        Path("u.csv").write_text(f"{header},torque\n" + f"{steer},0\n" * 10, encoding="utf-8")
        last.append(figures(koop("predict", predictor, "--x0", "15,0", "--inputs", "u.csv", "--json"))["last"])
    assert last[0] == pytest.approx(last[1])
    assert last[1] == last[2]


def test_what_a_prediction_from_a_state_assumes_is_said(koop, log, folder):
    predictor = koop("fit-edmd", log).name
    done = koop("predict", predictor, "--x0", "200,0")
    assert "x0 lies outside the states of training: v_x 200 (training" in done.err
    assert "no inputs are given: they are taken to be zero" in done.err


@pytest.mark.parametrize("dt", ["0.03", "0.07"])
def test_a_period_that_does_not_divide_the_memory_is_selected_on_too(bring, koop, dt, folder):
    log = bring(swap={"dt = 0.04": f"dt = {dt}"}).name
    told = figures(koop("select", log, "--no-bicycle", "--json"))
    predictor = koopcli.load(told["chosen"])
    assert predictor.memory == round(0.2 / float(dt))


def test_a_log_in_doubt_has_a_verdict_in_doubt(bring, koop, folder):
    log = bring(swap={"sign = -1": "sign = 1"}).name
    assert "koop import asks about" in figures(koop("select", log, "--no-bicycle", "--json"))["verdict"]


def test_a_log_of_other_signals_is_refused_alike(bring, koop, log, folder):
    predictor = koop("fit-edmd", log).name
    other = bring(swap={"torque = {": "pull = {"}).name
    told = "the predictor has the inputs steer (rad), torque (N m), the log steer (rad), pull (N m)"
    one_line(koop("predict", predictor, "--from", other, "--at", "3"), 3, told)
    one_line(koop("evaluate", predictor, "--on", other), 3, told)


def test_what_makes_no_sense_is_refused(koop, log, folder):
    predictor = koop("fit-edmd", log).name
    one_line(koop("import", str(SIMULATED)), 2, "a map is needed")
    one_line(koop("import", "nothing*.csv", "--map", "map.toml"), 3, "'nothing*.csv' matches no file")
    one_line(koop("select", predictor), 4, "DATA must be of stage import")
    one_line(koop("predict", predictor, "--from", log), 2, "--from LOG goes with --at S")
    one_line(koop("predict", predictor), 2, "say where to start")
    one_line(koop("predict", predictor, "--from", log, "--at", "1e4"), 3, "the log has no row at 10000 s")
    one_line(koop("predict", predictor, "--from", log, "--at", "0"), 3, "in one piece before")
    one_line(koop("predict", predictor, "--x0", "15"), 3, "x0 has 1 numbers")
    one_line(koop("predict", predictor, "--x0", "15,a"), 3, "numbers with commas between them")
    one_line(koop("plot", "log"), 3, "name it")
    assert koop("import", str(SIMULATED), "--suggest", "-o", "first.toml").code == 0
    one_line(koop("import", str(SIMULATED), "--suggest", "-o", "first.toml"), 2, "is there already")
    one_line(koop("import", str(SIMULATED), "--suggest", "-o", "no/first.toml"), 6, "cannot write no/first.toml")
    one_line(koop("import", str(SIMULATED), "--suggest", "--map", "map.toml"), 2, "leave out --map")
    one_line(koop("select", log, "--report", "no/verdict.html"), 6, "cannot write no/verdict.html")
    one_line(koop("predict", predictor, "--from", log, "--at", "3", "--x0", "1,2"), 2, "choose one")
    one_line(koop("fit-edmd", log, "--terms", "bilinear"), 3, "multiply inputs with past states too")
    one_line(koop("fit-edmd", log, "--ridge", "1"), 3, "set fit-edmd.increment_ridge")
    one_line(koop("fit-edmd", log, "--memory", "0.05"), 3, "no whole number of steps of 0.04 s")
    one_line(koop("fit-edmd", log, log), 3, "is named twice")
    simulated = koop("simulate", "--set", "sample.count=3", "--set", "sample.columns=1").name
    one_line(koop("fit-edmd", log, simulated), 3, f"{simulated} is simulated, and the others are logs")
    one_line(koop("fit-edmd", simulated, log), 3, f"{simulated} is simulated, and the others are logs")
    one_line(koop("control", "spin", "--predictor", predictor), 3, "was fitted to a log: there is no simulated car")
    one_line(koop("evaluate", "--on", log), 2, "name the predictor to score on this log")
