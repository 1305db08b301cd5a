"""Closed loops from the command line: what is driven, by what, and what is refused."""

from __future__ import annotations

import csv
import io
import json
import time
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import koopcli
from tests.cli.test_errors import one_line

QUICK = ("--plant", "slips", "--seconds", "0.3")


@pytest.fixture
def koop(koop):
    """The command line without the small datasets of other tests."""
    return partial(koop, tiny=False)


def figures(result):
    assert result.code == 0, result.err
    return json.loads(result.out)


def test_a_recovery_without_a_solver(koop, folder, monkeypatch):
    monkeypatch.setattr("koopcli.stages.control.CLOCK", time.process_time)
    told = figures(koop("control", "spin", "--controller", "esc", "--plant", "slips", "--json"))
    assert 2 < told["settled"][0] < 3.5
    assert told["settled_share"] == 1.0
    assert told["kkt_worst"] is None
    assert told["unsolved"] == 0
    assert told["step_ms"]["median"] > 0
    loop = koopcli.load(told["name"])
    assert loop.states.shape == (1, 501, 3)
    assert np.array_equal(loop.states[0, 0], [20.0, 0.0, 6.0])
    again = koop("control", "spin", "--controller", "esc", "--plant", "slips")
    assert "reused" in again.err


def test_doing_nothing_settles_no_spin(koop, folder):
    done = koop("control", "spin", "--controller", "none", "--plant", "slips", "--seconds", "1")
    assert "never settled" in done.err


def test_a_predictor_recovers_and_is_made_where_none_is_named(koop, folder):
    pytest.importorskip("daqp")
    told = figures(koop("control", "drift-left", "--plant", "slips", "--seconds", "1.5", "--json"))
    assert told["settled"][0] == pytest.approx(1.1, abs=0.1)
    assert told["kkt_worst"] < 1e-6
    assert told["unsolved"] == 0


def test_random_states_are_the_first_of_those_of_their_seed(koop, folder):
    options = ("--controller", "none", *QUICK)
    few, more = (koopcli.load(koop("control", "random", "--count", count, *options).name) for count in ("3", "5"))
    assert np.array_equal(few.states, more.states[:3])
    other = koopcli.load(koop("control", "random", "--count", "3", "--seed", "1", *options).name)
    assert not np.isclose(few.states[:, 0], other.states[:, 0]).any()


def test_what_the_controller_does_not_know_is_in_the_plant_alone(koop, folder):
    known = koop("control", "spin", "--controller", "esc", *QUICK)
    other = koop("control", "spin", "--controller", "esc", *QUICK, "--set", "plant.mu_scale=0.5")
    settings = figures(koop("show", other.name, "--json"))["settings"]["control"]
    assert settings["vehicle"]["mu_scale"] != settings["driven"]["mu_scale"]
    assert not np.isclose(koopcli.load(known.name).states[0, -1], koopcli.load(other.name).states[0, -1]).any()


def test_a_scenario_of_ones_own(koop, folder):
    Path("own.toml").write_text('x0 = [15, 1, 0.2]\nseconds = 0.5\nreference = "road.csv"\n', encoding="utf-8")
    Path("road.csv").write_text("t,v_x,v_y,yaw_rate\n0,15,0,0\n0.5,15,0,0.3\n", encoding="utf-8")
    done = koop("control", "own.toml", "--controller", "esc", "--plant", "slips", "--csv", "-")
    header, *rows = csv.reader(io.StringIO(done.out))
    assert header[:3] == ["car", "time (s)", "v_x (m/s)"]
    assert len(rows) == 51
    assert float(rows[25][header.index("reference yaw_rate (rad/s)")]) == pytest.approx(0.15)


def test_noise_and_delay_are_drawn_from_their_seed(koop, folder):
    options = ("control", "spin", "--controller", "esc", *QUICK, "--noise", "0.1", "--delay", "2")
    a, b = (koopcli.load(koop(*options, "--seed", seed).name) for seed in ("1", "2"))
    assert not np.isclose(a.inputs[0, 5:], b.inputs[0, 5:]).all()
    assert not a.inputs[0, :2].any()  # two samples late


def test_what_makes_no_sense_is_refused(koop, folder):
    one_line(koop("control", "spiin"), 4, "unknown scenario 'spiin'", "spin")
    one_line(koop("control", "spin", "--controller", "esk"), 4, "unknown controller 'esk'", "esc")
    one_line(koop("control", "spin", "--controller", "esc", "--noise", "-1"), 3, "'noise' must be at least 0")
    one_line(koop("control", "spin", "--controller", "esc", "--set", "m=3"), 2, "plant.KEY=VALUE was expected")
    Path("own.toml").write_text("x0 = [15, 1]\n", encoding="utf-8")
    one_line(koop("control", "own.toml", "--controller", "esc"), 3, "'x0' must be v_x, v_y, yaw_rate")
    Path("own.toml").write_text("y0 = [15, 1]\n", encoding="utf-8")
    one_line(koop("control", "own.toml", "--controller", "esc"), 3, "must have x0")
    linear = koop("fit-edmd", "--order", "2", "--set", "sample.count=5", "--set", "sample.columns=2").name
    pytest.importorskip("daqp")
    one_line(koop("control", "spin", "--predictor", linear), 3, "needs a predictor with the dynamics 'generator'")
