"""Noise from the command line: simulated, found, smoothed, said, and refused where it makes no sense."""

from __future__ import annotations

import json

import numpy as np
import pytest

import koopcli
from koopcli.koopman.eigen.lookup.polyharmonic import SOFTER
from tests.cli.test_errors import one_line

SMALL = (
    "--set",
    "sample.budget=8",
    "--set",
    "sample.candidates=500",
    "--set",
    "fit-eigen.trust=false",
    "--set",
    "fit-eigen.rounds=0",
)
SMALL += ("--set", "fit-eigen.tabulate=0.5", "--experiment", "quick-eigen")


def figures(result):
    assert result.code == 0, result.err
    return json.loads(result.out)


def test_a_fit_finds_the_noise_says_it_and_is_scored_without(koop, folder):
    made = koop("fit-eigen", *SMALL, "--set", "simulate.noise=0.1", "--json", tiny=False)
    noise = {entry["state"]: (entry["deviation"], entry["unit"]) for entry in figures(made)["noise"]}
    assert noise["v_x"] == (pytest.approx(0.1, rel=0.05), "m/s")
    assert noise["yaw_rate"] == (pytest.approx(0.01, rel=0.4), "rad/s")
    assert figures(made)["softness"] in SOFTER
    assert "with noise of 0.1 m/s" in made.err
    assert "noise smoothed away: 0.1 m/s in v_x, 0.1 m/s in v_y, 0.007 rad/s in yaw_rate" in made.err
    name = figures(made)["name"]
    assert koopcli.load(name).regression.noise[0] == noise["v_x"][0]
    scored = figures(koop("evaluate", name, "--count", "50", "--set", "evaluate.relift=false", "--json", tiny=False))
    tested = figures(koop("show", scored["name"], "--json"))["settings"]["trajectories (simulate)"]
    assert tested["noise"] == 0.0


def test_noise_is_smoothed_unless_told_otherwise_and_nothing_else_is(koop):
    clean, noisy = (koop("simulate", "--plant", "slips", *noise).name for noise in ((), ("--noise", "0.05")))
    seen = figures(koop("fit-eigen", noisy, "--json"))
    assert seen["noise"] is not None
    assert seen["softness"] is None  # of the nearest sample
    left = koop("fit-eigen", noisy, "--no-smooth", "--json")
    assert figures(left)["noise"] is None
    assert "the trajectories hold noise, which is left in them: smooth them with --smooth" in left.err
    assert figures(koop("fit-eigen", clean, "--json"))["noise"] is None
    asked = figures(koop("fit-eigen", clean, "--smooth", "--json"))["noise"]
    assert asked[0]["deviation"] < 0.01


def test_noise_larger_than_the_motion_is_said(koop):
    noisy = koop("simulate", "--plant", "slips", "--noise", "50").name
    made = koop("fit-eigen", noisy)
    assert made.code == 0
    assert "the noise in v_x (49 m/s) is larger than the motion (18 m/s)" in made.err
    assert "no softness of a spline helps against it" in made.err


def test_noise_is_drawn_by_its_seed_however_trajectories_are_chunked(koop):
    x = {}
    for name, more in {"a": (), "b": ("simulate.chunk=90",), "c": ("simulate.noise_seed=1",)}.items():
        options = [text for setting in more for text in ("--set", setting)]
        x[name] = koopcli.load(koop("simulate", "--plant", "slips", "--noise", "0.1", *options).name).x[:]
    assert np.array_equal(x["a"], x["b"])
    assert (x["a"] != x["c"]).all()


def test_a_noisy_grid_is_no_product_of_states_and_inputs(koop):
    data = koop("simulate", "--noise", "0.1").name
    assert koopcli.load(data).product is None
    assert figures(koop("fit-edmd", data, "--json"))["rank"] == 27 + 4


def test_what_makes_no_sense_is_refused(koop):
    one_line(koop("simulate", "--noise", "-1"), 3, "'simulate.noise' must be at least 0 m/s, got -1")
    one_line(koop("simulate", "--noise", "nan"), 3, "'simulate.noise' must be a finite number, got nan")
    idle = koop("simulate", "--set", "simulate.noise_seed=3")
    one_line(idle, 2, "there is no noise without simulate.noise")
    short = koop("simulate", "--plant", "slips", "--steps", "4").name
    options = ("--smooth", "--set", "fit-eigen.tabulate=0.01", "--set", "fit-eigen.degree=1")
    one_line(koop("fit-eigen", short, *options), 3, "trajectories of 5 samples are too short to tell noise from motion")
