"""EDMD from the command line: its bases and terms, what it says of poor data, and what its scores are set beside."""

from __future__ import annotations

import csv
import io
import json

import numpy as np
import pytest

import koopcli
from tests.cli.test_errors import one_line


@pytest.mark.parametrize(
    ("options", "functions"),
    [
        pytest.param(["--order", "2"], 27, marks=pytest.mark.slow),
        pytest.param(["--basis", "total", "--order", "3"], 20, marks=pytest.mark.slow),
        pytest.param(["--basis", "anisotropic", "--order", "4", "--terms", "bilinear"], 15, marks=pytest.mark.slow),
        (["--basis", "anisotropic", "--order", "3", "--degree-velocity", "2", "--terms", "generator"], 24),
        pytest.param(["--basis", "thin-plate", "--centres", "12"], 16, marks=pytest.mark.slow),
        pytest.param(
            ["--basis", "thin-plate", "--placement", "drawn", "--terms", "bilinear", "--ridge", "1e-6"],
            24,
            marks=pytest.mark.slow,
        ),
        pytest.param(["--basis", "states"], 3, marks=pytest.mark.slow),
        pytest.param(["--order", "2", "--solver", "cholesky-monomials"], 27, marks=pytest.mark.slow),
    ],
)
def test_every_way_to_fit_is_stored_and_scored(koop, folder, options, functions):
    fit = json.loads(koop("fit-edmd", *options, "--json").out)
    assert fit["functions"] == functions
    assert fit["rank"] == fit["directions"]
    assert fit["condition"] >= 1
    assert fit["spectral_radius"] > 0.9
    scored = json.loads(koop("evaluate", fit["name"], "--json").out)
    assert scored["functions"] == functions
    assert scored["diverged"] == 0
    predictor = koopcli.load(fit["name"])
    assert np.isfinite(predictor.predict([3.0, 1.0, 0.5], np.full((4, 4), 10.0))).all()
    drawn = koop("plot", "random-input", fit["name"])
    assert drawn.code == 0, drawn.err
    assert koop("plot", "spectrum", fit["name"]).code == 0
    assert koop("show", fit["name"]).code == 0


@pytest.mark.parametrize(
    ("options", "code", "parts"),
    [
        (["--basis", "thin-plate", "--centres", "300"], 3, ["300 is too many for 125 different states", "lower it"]),
        (["--basis", "anisotropic", "--degree-velocity", "5"], 3, ["'fit-edmd.degree_velocity' 5 is too high for 5"]),
        (
            ["--basis", "total", "--degree-velocity", "2"],
            2,
            ["belongs to basis 'anisotropic', and this"],
        ),
        (["--basis", "thin-plate", "--order", "3"], 2, ["and this basis is 'thin-plate'"]),
        (["--centres", "30"], 2, ["'fit-edmd.centres' belongs to basis 'thin-plate', and this basis is 'tensor'"]),
        (["--terms", "cubic"], 2, ["'cubic' is not one of"]),
        (["--ridge", "-1"], 3, ["'fit-edmd.ridge' must be at least 0"]),
        (["--solver", "cholesky-monomials", "--ridge", "0.1"], 3, ["without 'fit-edmd.ridge'"]),
        (["--solver", "cholesky-monomials", "--basis", "thin-plate"], 3, ["is for polynomials"]),
        (["--terms", "generator", "--basis", "states"], 3, ["need a constant", "use 'total'"]),
        (["--basis", "total", "--order", "60"], 3, ["the limit is 4,096 terms"]),
    ],
)
def test_bad_input_is_one_line(koop, folder, options, code, parts):
    one_line(koop("fit-edmd", *options), code, *parts)
    assert not list((folder / "artefacts").rglob("*.h5"))


def test_more_functions_than_samples(koop):
    few = ["--set", "sample.kind=point", "--set", "sample.steps=40"]
    one_line(koop("fit-edmd", *few, "--order", "4"), 3, "40 samples cannot determine 125 functions", "sample more")
    one_line(
        koop("fit-edmd", *few, "--order", "2", "--terms", "bilinear"), 3, "40 samples", "135 bilinear terms together"
    )
    one_line(koop("fit-edmd", *few, "--basis", "thin-plate", "--centres", "50"), 3, "50 centres", "40 different states")


def test_poor_data_are_named_with_a_remedy(koop):
    still = koop("fit-edmd", "--set", "sample.levels=[0]", "--terms", "bilinear")
    assert still.code == 0
    assert "F_fx, F_fy, F_rx, F_ry never moved in these data" in still.err
    assert "sample.levels" in still.err
    assert json.loads(koop("evaluate", still.name, "--json").out)["diverged"] == 0
    outside = koop("fit-edmd", "--basis", "thin-plate", "--placement", "drawn")
    assert "centres lie outside the data" in outside.err
    assert "--placement k-means" in outside.err
    drowned = koop("fit-edmd", "--order", "4", "--solver", "cholesky-monomials")
    assert "use the solver 'orthonormal'" in drowned.err


def test_a_predictor_stands_beside_its_baselines(koop):
    """Three of them, each an artefact of its own, and a verdict by the mean error."""
    done = koop("evaluate", "--json")
    found = json.loads(done.out)
    assert set(found["baselines"]) == {"hold", "linearisation", "linear"}
    for one in found["baselines"].values():
        assert json.loads(koop("show", one["name"], "--json").out)["figures"]["rmse"] == one["rmse"]
    best = min(one["rmse"]["mean"] for one in found["baselines"].values())
    assert found["beats_baselines"] == (found["rmse"]["mean"] < best)
    assert found["verdict"] in done.err
    linear = json.loads(koop("evaluate", "--set", "fit-edmd.basis=total", "--set", "fit-edmd.order=1", "--json").out)
    assert set(linear["baselines"]) == {"hold", "linearisation"}  # it is one of them itself
    assert linear["rmse"] == found["baselines"]["linear"]["rmse"]


def test_the_verdict_is_plain(koop):
    poor = koop("evaluate", koop("fit-edmd", "--basis", "states").name)
    assert "warning: the predictor, with" in poor.err
    assert "does not beat the baseline" in poor.err
    assert "the baseline 'linearisation at the first state'" in poor.err
    good = ["--set", "fit-edmd.basis=anisotropic", "--set", "fit-edmd.order=4", "--set", "fit-edmd.terms=generator"]
    driven = koop("evaluate", *good, "--steps", "30", "--excitation", "held", "--count", "20")
    assert "beats every baseline" in driven.err
    assert "warning: the predictor" not in driven.err


def test_scores_on_what_was_fitted_are_called_so(koop):
    """Each time, whether they are made or found."""
    few = ("--set", "sample.count=3", "--set", "sample.levels=[100]", "--set", "evaluate.chunk=100")
    data = koop("simulate", *few[:4]).name
    for _ in range(2):
        done = koop("evaluate", *few, "--on", data[:14], "--json")
        assert "warning: the predictor was fitted to these test trajectories" in done.err
        assert json.loads(done.out)["fitted_to_test_data"] is True
    usual = koop("evaluate", *few, "--json")
    assert "was fitted to these" not in usual.err
    assert json.loads(usual.out)["fitted_to_test_data"] is False


def test_predictions_that_restart(koop):
    """The paper's one trajectory, in stretches; the table has a row for each."""
    done = koop("evaluate", "--restart", "80", "--json")
    found = json.loads(done.out)
    assert [segment["start"] for segment in found["segments"]] == [0, 80, 160, 240]
    assert found["trajectories"] == 1
    for segment in found["segments"]:
        assert f"RMSE {segment['rmse']:.4g} %" in done.err
    rows = list(csv.DictReader(io.StringIO(koop("show", found["name"], "--csv").out)))
    assert [float(row["start (samples)"]) for row in rows] == [0, 80, 160, 240]
    assert [float(row["rmse (%)"]) for row in rows] == [segment["rmse"] for segment in found["segments"]]
    first = json.loads(koop("evaluate", "--set", "test.kind=point", "--steps", "80", "--json").out)
    assert first["rmse"]["mean"] == pytest.approx(found["segments"][0]["rmse"], rel=1e-9)
    one_line(koop("plot", "horizon", found["name"]), 3, "restart every 80 steps", "without --restart")
    one_line(koop("evaluate", "--restart", "7", "--set", "evaluate.first=7"), 3, "the 6 steps of the shortest")
    one_line(koop("evaluate", "--restart", "50", "--count", "3"), 2, "this test is 'point'")
    boxed = json.loads(koop("evaluate", "--restart", "2", "--set", "test.kind=box", "--json").out)
    assert boxed["trajectories"] == 40
    assert len(boxed["segments"]) == 3


def test_test_states_on_a_grid(koop):
    found = json.loads(koop("evaluate", "--set", "test.layout=product", "--count", "27", "--json").out)
    rows = csv.DictReader(io.StringIO(koop("show", found["name"], "--csv").out))
    states = np.array([[float(row[f"{name}_0 ({unit})"]) for name, unit in STATES] for row in rows])
    assert [len(np.unique(column)) for column in states.T] == [3, 3, 3]
    assert len(np.unique(states, axis=0)) == 27
    one_line(koop("evaluate", "--set", "test.layout=product"), 3, "'test.count' 40", "as 27 is")


STATES = (("v_x", "m/s"), ("v_y", "m/s"), ("yaw_rate", "rad/s"))


BOX = ("--set", "sample.kind=box", "--set", "sample.steps=3")


def several(koop):
    """Two sets of trajectories of one plant, of different lengths."""
    one = koop("simulate", *BOX, "--set", "sample.count=60").name
    other = koop("simulate", "--set", "sample.kind=box", "--set", "sample.count=50", "--set", "sample.seed=3").name
    return one, other


def test_several_trajectories_are_fitted_together(koop):
    one, other = several(koop)
    fit = json.loads(koop("fit-edmd", one, other, "--json").out)
    both = koopcli.load(fit["name"])
    alone = [koopcli.load(koop("fit-edmd", name).name) for name in (one, other)]
    assert not any(np.array_equal(both.dynamics.A, single.dynamics.A) for single in alone)
    low, high = (f([single.coverage.domain for single in alone]) for f in (lambda d: d[0][0], lambda d: d[1][1]))
    assert (both.coverage.domain[0] <= low).all()
    assert (both.coverage.domain[1] >= high).all()
    again = koop("fit-edmd", one, other, "--set", "fit-edmd.chunk=37")
    assert pytest.approx(both.dynamics.A, rel=1e-8, abs=1e-9) == koopcli.load(again.name).dynamics.A
    scored = json.loads(koop("evaluate", fit["name"], "--json").out)
    assert {"hold", "linear"} <= scored["baselines"].keys()
    assert koop("show", "--lineage", fit["name"]).out.count("simulate/") == 2


def test_trajectories_that_do_not_belong_together_are_refused(koop):
    one, _ = several(koop)
    slower = koop("simulate", *BOX, "--set", "simulate.dt=0.02").name
    one_line(koop("fit-edmd", one, slower), 3, "differ in dt")
    heavier = koop("simulate", *BOX, "--set", "vehicle.m=1500").name
    one_line(koop("fit-edmd", one, heavier), 3, "differ in vehicle")
    one_line(koop("fit-edmd", one, one), 3, "is named twice")
    one_line(koop("fit-edmd", one, koop("sample").name), 4, "must be of stage simulate")
    one_line(koop("fit-edmd", one, "nothing"), 4, "no artefact 'nothing'")


def test_what_solved_a_fit_is_said(koop):
    assert json.loads(koop("fit-edmd", "--json").out)["solved_by"] == "averages"
    one, _ = several(koop)
    found = koop("fit-edmd", one, "--json")
    assert json.loads(found.out)["solved_by"] in ("moments", "normal equations")
    assert f"by {json.loads(found.out)['solved_by']}" in found.err
    assert json.loads(koop("fit-eigen", "--json").out)["solved_by"] == ""
