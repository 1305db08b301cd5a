"""Eigenfunctions beyond the paper from the command line."""

from __future__ import annotations

import json
import re
import shlex

import numpy as np
import pytest

import koopcli
from tests import stock
from tests.cli.test_errors import one_line
from tests.conftest import TINY

SMALL = ("--set", "sample.budget=25", "--experiment", "best-eigen")


def figures(result):
    assert result.code == 0, result.err
    return json.loads(result.out)


def test_from_nothing_to_a_predictor_that_knows_its_errors(koop, folder):
    made = koop("fit-eigen", *SMALL, "--json", tiny=False)
    predictor = figures(made)
    assert predictor["functions"] == 66
    assert predictor["horizon"] == 50
    assert predictor["modes"] == 22
    assert predictor["nodes"] == 2 * 25 * (101 - 5)
    assert predictor["missed"] < 0.2
    assert predictor["trust"]["level"] == 0.9
    assert "an eigenfunction has several values" in made.err
    scored = koop("evaluate", predictor["name"], "--count", "200", "--json", tiny=False)
    found = figures(scored)
    assert found["rmse"]["mean"] < 15
    assert found["beats_baselines"] is True
    assert 0.7 < found["bound"]["covered"] <= 1
    assert "of the errors are within their 90 % bounds" in scored.err
    assert f"{found['outside']} of 200 test states lie outside the data" in scored.err
    assert "predictions from there continue the local spline" in scored.err
    header, *rows = koop("show", found["name"], "--csv").out.splitlines()
    bounds = np.array([float(row.split(",")[header.split(",").index("bound (%)")]) for row in rows])
    assert (bounds > 0).all()
    again = koopcli.load(predictor["name"])
    assert again.bound(np.array([[20.0, 3.0, 1.0]])).shape == (1,)


def test_a_predictor_without_trust_has_no_bounds(koop):
    found = figures(koop("evaluate", koop("fit-eigen").name, "--json"))
    assert found["bound"] is None
    one_line(koop("plot", "trust", found["name"]), 3, "says nothing of its errors: fit with --trust")


@pytest.mark.slow
def test_lifts_and_rates_by_option(koop):
    data = koop("simulate", "--plant", "slips").name
    scores = {}
    both = ("--mirror", "left-right", "--mirror", "front-rear")
    for options in (
        ("--boundary", "optimal", "--lift", "linear"),
        ("--boundary", "optimal", "--eigenvalues", "comb", "--pairs", "3", "--cut", "1e-10", "--lift", "mls"),
        ("--eigenvalues", "varpro", "--pairs", "2", "--window", "horizon", "--lift", "linear"),
        ("--eigenvalues", "comb", "--pairs", "2", "--window", "horizon", *both),
    ):
        made = figures(koop("fit-eigen", data, *options, "--json"))
        found = figures(koop("evaluate", made["name"], "--json"))
        scores[options] = found["rmse"]["mean"]
        assert found["diverged"] == 0
    assert len(set(scores.values())) == 4


def test_the_relifted_score_can_be_left_out(koop):
    predictor = koop("fit-eigen").name
    found = figures(koop("evaluate", predictor, "--set", "evaluate.relift=false", "--json"))
    whole = figures(koop("evaluate", predictor, "--json"))
    assert found["rmse_relift"]["mean"] is None
    assert found["diverged_relift"] == 0
    assert found["rmse"] == whole["rmse"]


BEST = ("--experiment", "best-eigen")
QUICK = ("--experiment", "quick-eigen")


@pytest.mark.parametrize(
    ("args", "code", "says"),
    [
        (["sample", "greedy", "--budget", "0.5"], 3, "'sample.budget' of 0.5 s does not pay for one trajectory of 1 s"),
        (["sample", "greedy", "--set", "sample.candidates=5"], 3, "more than the states to choose from"),
        (["sample", "greedy", "--set", "sample.usable=2"], 3, "'sample.usable' of 2 s is longer than trajectories"),
        (["sample", "greedy", "--set", "sample.dt=0.02"], 2, "'sample.dt' is the simulation's: set simulate.dt"),
        (["sample", "greedy", "--set", "sample.vehicle=3"], 2, "choose it by vehicle.name"),
        (["sample", "greedy", "--mirror", "front-rear", "--vehicle", "bmw-320i"], 3, "no front-rear symmetry"),
        (["sample", "ellipsoid", "--budget", "10"], 2, "'sample.budget' belongs to sample 'greedy'"),
        (["fit-eigen", *BEST, "--mirror", "sideways"], 2, "choose one of left-right, front-rear"),
        (["fit-eigen", *BEST, "--mirror", "front-rear", "--vehicle", "efremov-2020"], 3, "no front-rear symmetry"),
        (["fit-eigen", *BEST, "--set", "fit-eigen.horizon=1.5"], 3, "'fit-eigen.horizon' of 1.5 s is longer"),
        (["fit-eigen", *QUICK, "--set", "fit-eigen.rounds=0"], 3, "'fit-eigen.tabulate' of 1 s leaves nothing"),
        (["fit-eigen", *QUICK, "--lookup-steps", "5"], 3, "a short lookup needs no continuation"),
        (["fit-eigen", *BEST, "--lookup-steps", "0"], 3, "'fit-eigen.lookup_steps' must be"),
        (["fit-eigen", *BEST, "--lookup-steps", "101"], 3, "of 101 is longer than trajectories of 100 steps"),
        (["fit-eigen", *BEST, "--set", "fit-eigen.scale=[1,2]"], 3, "has 2 numbers for 3 states"),
        (["fit-eigen", "--lookup-steps", "5"], 2, "'fit-eigen.lookup_steps' belongs to window 'horizon'"),
        (["fit-eigen", "--window", "horizon", "--set", "fit-eigen.rounds=1"], 3, "set fit-eigen.horizon too"),
        (["fit-eigen", "--window", "horizon", "--set", "fit-eigen.horizon=1"], 3, "do not hold the horizon of 1 s"),
        (["fit-eigen", "--coordinates", "world"], 2, "'fit-eigen.coordinates' belongs to window 'horizon'"),
        (
            ["fit-eigen", "--window", "horizon", "--boundary", "optimal"],
            2,
            "and this window is 'horizon'",
        ),
        (["fit-eigen", "--pairs", "3"], 2, "these eigenvalues are 'dmd'"),
        (["fit-eigen", "--eigenvalues", "comb", "--pairs", "99"], 3, "200 rates are too many for windows of 150 steps"),
        (
            ["fit-eigen", "--eigenvalues", "comb", "--set", "fit-eigen.lowest=30"],
            3,
            "must be below 'fit-eigen.highest'",
        ),
        (["fit-eigen", "--lift", "linear", "--set", "fit-eigen.neighbours=9"], 2, "and this lift is 'linear'"),
        (["reproduce", "edmd", "--beyond"], 2, "--beyond belongs to eigenfunctions"),
        (["reproduce", "eigen", "--beyond", "--set", "sample.greedy.budget=3"], 2, "changes nothing in reproduce"),
    ],
)
def test_bad_input(koop, args, code, says):
    one_line(koop(*args, tiny=False), code, says)


@pytest.mark.parametrize(
    ("sets", "says"),
    [
        (["fit-eigen.nodes=1"], "'polyharmonic' needs 40 nodes and the data have"),
        (["fit-eigen.neighbours=5"], "'fit-eigen.neighbours' must be at least 10"),
        (["fit-eigen.lift=linear", "fit-eigen.nodes=1", "sample.budget=1"], "'linear' needs 4 nodes"),
    ],
)
def test_data_too_few_for_the_lift(koop, sets, says):
    told = [word for one in ("sample.budget=8", *sets) for word in ("--set", one)]
    result = koop("fit-eigen", *BEST, *told, tiny=False)
    assert result.code == 3
    assert f"koop: the lift {says}" in result.err or f"koop: {says}" in result.err


def test_mirror_images_need_a_car_that_rolls_by_itself(koop):
    grid = ["--set", "sample.levels=[0]"]
    data = koop("simulate", koop("sample", "grid", *grid).name, "--steps", "30").name
    assert koop("fit-eigen", data, "--mirror", "left-right").code == 0  # no inputs
    result = koop("fit-eigen", koop("simulate").name, "--mirror", "left-right")
    one_line(result, 3, "drives its trajectories with inputs that change")


def test_shells_are_checked_one_by_one(koop):
    made = koop("fit-eigen", "--set", "sample.shells=3", "--set", "sample.mesh=fibonacci")
    assert made.code == 0, made.err
    assert "no trajectory comes back to its own one of the 3 surfaces" in made.err


def test_a_greedy_sample_depends_on_the_vehicle(koop):
    names = {
        koop("sample", "greedy", "--budget", "6", *more).name
        for more in ((), ("--vehicle", "rimac-2018"), ("--set", "vehicle.mu_scale=0.7"), ("--mirror", "left-right"))
    }
    assert len(names) == 4
    same = koop("sample", "greedy", "--budget", "6", "--set", "vehicle.m=1300")
    assert same.name in names
    result = koop("sample", "greedy", "--budget", "6", "--set", "vehicle.r_w=0.4")
    one_line(result, 2, "the plant 'slips' has no use for it")


@pytest.fixture
def beyond(folder, stocks) -> None:
    """The test's store begins with all that `koop reproduce eigen --beyond` makes."""
    made = stock.obtain(stocks, TINY, "beyond", [["reproduce", "eigen", "--beyond"]])
    stock.link(made, folder / "artefacts")


@pytest.mark.slow  # 47 s of CPU for what `reproduce --beyond` makes
def test_beyond_in_one_command(koop, folder, beyond):
    result = koop("reproduce", "eigen", "--beyond", "--json")
    assert result.code == 0, result.err
    found = json.loads(result.out)
    cells = [cell for run in found["runs"] if run["method"] == "beyond" for cell in run["evaluations"]]
    blocks = {cell["block"] for cell in cells}
    assert blocks == {"ladder", "budgets", "edmd", "ablation", "modes", "unseen"}
    ladder = [c for c in cells if c["block"] == "ladder" and c["vehicle"] == "ctu-2020" and c["seed"] == 0]
    assert len(ladder) == 15
    assert ladder[-1]["rmse"]["mean"] < ladder[0]["rmse"]["mean"] / 2
    assert ladder[-1]["simulated"] == pytest.approx(30)
    assert all(cell["query"] > 0 and cell["build"] > 0 for cell in ladder)
    drawn = [one["figure"] for one in found["figures"] if one["method"] == "beyond"]
    of_a_vehicle = ["before-after", "trust", "trust", "horizon", "modes", "compare"]
    assert drawn == ["frontier", *(of_a_vehicle * 2)]
    assert all(one["name"] for one in found["figures"])
    for title in (
        "Beyond the paper: RMSE",
        "Where the error of best-eigen comes from",
        "One ingredient taken away",
        "How many modes",
        "Trust: 90 % bounds",
    ):
        assert title in result.err
    page = next((folder / "artefacts" / "reports").glob("*/report.html")).read_text()
    assert "koop reproduce eigen --beyond --experiment" in re.sub("<[^>]*>", "", page)
    assert koop("reproduce", "eigen", "--beyond", "--dry-run").out.count(" make ") == 0  # all of it is there


def test_labels_of_ones_own(koop, folder):
    data = koop("simulate", "--plant", "slips").name
    both = [koop("evaluate", koop("fit-eigen", data, *more).name).name for more in ((), ("--lift", "linear"))]
    drawn = koop("plot", "compare", *both, "--label", "one $x$", "--label", "_other", "--csv", "c.csv")
    assert drawn.code == 0, drawn.err
    assert "one $x$/mean (%)" in (folder / "c.csv").read_text()
    one_line(koop("plot", "compare", *both, "--label", "one"), 2, "--label is given 1 times for 2 artefacts")
    one_line(koop("plot", "error-map", both[0], "--label", "one"), 2, "--label changes nothing here")


@pytest.mark.slow
def test_the_commands_of_the_report_draw_its_pictures(koop, beyond):
    """Whatever a picture calls its artefacts, the command under it does too."""
    found = json.loads(koop("reproduce", "eigen", "--beyond", "--json").out)
    for one in found["figures"]:
        if one["method"] == "beyond" and one["figure"] in ("before-after", "compare", "trust"):
            words = shlex.split(one["command"])[1:]
            assert koop(*words, tiny=False).name == one["name"], one["command"]
