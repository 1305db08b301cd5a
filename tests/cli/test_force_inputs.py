"""Predictors with force inputs from the command line: their test set, how they are asked, what is refused."""

from __future__ import annotations

import json

import numpy as np
import pytest

import koopcli
from koopcli.config.experiment import load_experiment
from koopcli.stages import recipes
from koopcli.stages.recorded import recipe_of
from koopcli.stages.verdict import NAMES
from tests.cli.test_errors import one_line

SMALL = """
[experiment]
fit = "fit-eigen"
[sample]
kind = "greedy"
[sample.greedy]
budget = 40.0
candidates = 1000
[fit-eigen]
trust = true
eigenvalues = "comb"
cut = 1e-10
window = "horizon"
horizon = 0.4
tabulate = 0.6
lift = "polyharmonic"
coordinates = "world"
radial_power = 0.5
spacing = 4
[test.ball]
count = 20
steps = 10
[test.ball-forces]
count = 20
steps = 20
[evaluate]
relift = false
"""
FORCES = ("--set", "fit-eigen.inputs=forces")


@pytest.fixture
def run(koop, folder, store_of_this_file, monkeypatch):
    """Run a command on the small experiment, in one store for all tests of this file."""
    (folder.parent / "small.toml").write_text(SMALL)
    monkeypatch.setenv("KOOP_STORE", str(store_of_this_file))

    def run(command, *rest):
        makes = command in ("evaluate", "fit-eigen", "sweep", "plot")
        return koop(command, *rest, *(("--experiment", "../small.toml") if makes else ()), tiny=False)

    return run


@pytest.fixture(scope="module")
def store_of_this_file(tmp_path_factory):
    return tmp_path_factory.mktemp("forces") / "store"


def figures(result):
    assert result.code == 0, result.err
    return json.loads(result.out)


@pytest.fixture
def predictor(run):
    """The name of a predictor with force inputs."""
    return run("fit-eigen", *FORCES).name


@pytest.mark.slow  # likewise
def test_from_nothing_to_a_score(run):
    """The car coasts in training and is pushed in the test; the score beats all baselines by far."""
    done = run("evaluate", *FORCES, "--json")
    scored = figures(done)
    assert scored["rmse"]["mean"] < 5
    assert scored["beats_baselines"]
    assert scored["baselines"].keys() == NAMES.keys()
    assert scored["rmse"]["mean"] < 0.3 * scored["baselines"]["linearisation"]["rmse"]["mean"]
    assert (scored["trajectories"], scored["steps"]) == (20, 20)
    settings = figures(run("show", scored["name"], "--json"))["settings"]
    assert settings["trajectories (simulate)"]["plant"] == "axle-forces"
    assert settings["trajectories / sample (sample)"]["kind"] == "ball-forces"
    assert settings["predictor / trajectories (simulate)"]["plant"] == "slips"
    assert settings["evaluate"]["first"] == 0
    assert "another vehicle or plant" not in done.err
    assert scored["start_error"]["mean"] > 0


def test_a_named_predictor_has_the_same_test_and_is_found_again(run, predictor):
    """By its name or by the settings of its fit; the second run makes nothing."""
    first = run("evaluate", predictor)
    again = run("evaluate", predictor)
    assert first.code == again.code == 0
    assert again.name == first.name == run("evaluate", *FORCES).name
    assert "made in" not in again.err


def test_every_input_matrix_is_asked_without_a_new_fit(run, predictor):
    """Four ways, four evaluations of one predictor; the frozen one errs most, the one linear between ends less."""
    scores, names = {}, set()
    for where in ("first", "every", "between", "relift"):
        done = run("evaluate", predictor, "--input-matrix", where, "--json")
        assert "fit-eigen" not in [line.split("/")[0] for line in done.err.splitlines() if "made in" in line]
        made = figures(done)
        scores[where], names = made["rmse"]["mean"], names | {made["name"]}
    assert len(names) == 4
    assert scores["between"] < scores["every"] < scores["first"]
    assert figures(run("evaluate", predictor, "--json"))["rmse"]["mean"] == scores["every"]
    finer = figures(run("evaluate", predictor, "--every", "2", "--json"))
    assert finer["rmse"]["mean"] < scores["first"]


def test_another_input_matrix_makes_no_other_baseline(run, predictor):
    """Baselines have no input matrix, so they are scored once."""
    baselines = [
        figures(run("evaluate", predictor, "--input-matrix", where, "--json"))["baselines"]
        for where in ("first", "every")
    ]
    assert baselines[0] == baselines[1]


@pytest.mark.slow  # seconds of fits and scores
def test_asked_is_as_good_as_fitted(run, predictor):
    """What is asked with an input matrix answers as what was fitted with it, whose horizon may be longer."""
    fitted = run("fit-eigen", *FORCES, "--input-matrix", "relift").name
    a = koopcli.load(run("evaluate", fitted).name)
    b = koopcli.load(run("evaluate", predictor, "--input-matrix", "relift").name)
    assert np.array_equal(a.rmse, b.rmse)
    one_line(run("evaluate", fitted, "--steps", "60", "--input-matrix", "first"), 3, "may be asked for 40 at most")


@pytest.mark.slow  # seconds of fits and scores
def test_larger_forces_are_harder(run, predictor):
    """The share of the grip and how long forces are held are options."""
    errors = [
        figures(run("evaluate", predictor, "--grip-share", share, "--input-matrix", "first", "--json"))["rmse"]["mean"]
        for share in ("0.01", "2")
    ]
    assert errors[1] > 1.5 * errors[0]
    held = run("evaluate", predictor, "--hold", "20").name
    test = figures(run("show", held, "--json"))["settings"]["trajectories / sample (sample)"]
    assert test["hold"] == 20


@pytest.mark.slow  # seconds of fits and scores
def test_a_coasting_predictor_is_scored_beside_it_and_ignores_forces(run, predictor):
    """On the same trajectories: what does not know forces errs more, and is told so."""
    pushed = run("evaluate", predictor, "--json")
    test = figures(run("show", figures(pushed)["name"], "--json"))["inputs"]["trajectories"]
    done = run("evaluate", run("fit-eigen").name, "--on", test, "--json")
    assert figures(done)["rmse"]["mean"] > 1.5 * figures(pushed)["rmse"]["mean"]
    assert figures(done)["bound"] is None
    assert "the test trajectories have inputs, of which this predictor knows nothing" in done.err


def test_a_predictor_whose_trajectories_are_gone_is_tested_alike(run, predictor, store_of_this_file):
    """It remembers the plant that it was fitted to."""
    first = run("evaluate", predictor).name
    gone = [
        *(store_of_this_file / "records" / "simulate").iterdir(),
        *(store_of_this_file / "records" / "evaluate").iterdir(),
    ]
    kept = {path: path.read_bytes() for path in gone}
    for path in gone:
        path.unlink()
    try:
        again = run("evaluate", predictor)
        assert again.code == 0, again.err
        assert again.name == first
        assert "there are no baselines" in again.err
    finally:
        for path, content in kept.items():
            path.write_bytes(content)


@pytest.mark.slow  # seconds of fits and scores
def test_all_baselines_are_scored_on_such_a_test_set(run):
    """Hold, rotation and linearisation, with EDMD beside them, in one figure."""
    assert run("plot", "compare", *FORCES).code == 0


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--grip-share", "0"), "'test.grip_share' must be above 0, got 0"),
        (("--grip-share", "2.5"), "'test.grip_share' must be at most 2, got 2.5"),
        (("--hold", "0"), "'test.hold' must be at least 1, got 0"),
        (("--every", "0"), "'evaluate.every' must be at least 1, got 0"),
    ],
)
def test_bad_options_are_refused(run, options, says):
    """In one line, before anything is made."""
    one_line(run("evaluate", *FORCES, *options), 3, says)


def test_options_without_effect_are_refused(run):
    """Those of forces for a coasting predictor, and stretches where there are none."""
    one_line(run("evaluate", "--input-matrix", "first"), 2, "the predictor has no force inputs")
    one_line(run("evaluate", "--every", "3"), 2, "the predictor has no force inputs")
    one_line(run("evaluate", "--grip-share", "0.3"), 2, "belongs to test 'ball-forces'")
    rest = ("--input-matrix", "first", "--every", "3", "--dry-run")
    one_line(run("evaluate", *FORCES, *rest), 2, "only an input matrix of every or between")


def test_coasting_trajectories_are_no_test_of_forces(run, predictor):
    """Their inputs are slips and steer."""
    calm = figures(run("show", run("evaluate").name, "--json"))["inputs"]["trajectories"]
    one_line(run("evaluate", predictor, "--on", calm), 3, "of the plant 'axle-forces'", "of 'slips'")


def test_a_prediction_under_forces(run, predictor, folder):
    """One column for every force: pushed forward at both axles the car is faster than coasting."""
    (folder / "push.csv").write_text("dF_fx,dF_fy,dF_rx,dF_ry\n" + 10 * "1300,0,1300,0\n")
    pushed = koopcli.load(run("predict", predictor, "--x0", "15,0.2,0.1", "--inputs", "push.csv").name)
    calm = koopcli.load(run("predict", predictor, "--x0", "15,0.2,0.1", "--seconds", "0.1").name)
    gain = pushed.table()[1], calm.table()[1]
    faster = [float(list(rows)[-1][1]) for rows in gain]
    mass = koopcli.load(predictor).plant["vehicle"]["m"]
    assert faster[0] - faster[1] == pytest.approx(0.1 * 2600 / mass, rel=0.05)


def test_an_input_matrix_is_in_the_key_of_an_evaluation_only_where_it_is_given():
    """Evaluations without one are recorded as before there were any."""

    def recorded(**changes):
        experiment = load_experiment("quick-eigen", changes)
        return recipe_of(recipes.evaluation(experiment, recipes.predictor(experiment)), {})["settings"]

    forces, first = {"inputs": "forces"}, {"input_matrix": "first"}
    assert recorded() == recorded(**{"fit-eigen": forces}) == {"first": 0, "relift": True}
    assert recorded(**{"fit-eigen": forces, "evaluate": first}) == {"first": 0, "relift": True, **first}
    assert recorded(**{"fit-eigen": {**forces, **first}, "evaluate": {"every": 3}}) == {"first": 0, "relift": True}
