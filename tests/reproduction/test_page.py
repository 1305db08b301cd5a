"""The report as a page: complete, self-contained, and true to the numbers of `--json`."""

from __future__ import annotations

import json
import shlex
from dataclasses import replace

import numpy as np
import pytest

from koopcli.figures.drawing import Drawing
from koopcli.figures.registry import FIGURES, drawing
from koopcli.koopman import metrics
from koopcli.reproduction import turnable
from koopcli.reproduction.illustrations import Illustration
from koopcli.reproduction.page import Section, page
from koopcli.reproduction.report import Table
from tests.reproduction.pages import Page
from tests.stages.toys import figure_records, figure_settings

TABLE = Table("a <b> & c", ["", "paper"], [["row", "1 < 2"], ["  seed 1", "–"]])

OF_BEYOND = ("before-after", "modes", "frontier", "trust")  # figures of --beyond


def section(*illustrations):
    return Section("edmd", "EDMD", [TABLE], ["a note"], illustrations, replace(TABLE, title="every"))


def undrawn(reason="every prediction diverged"):
    return Illustration("orders", "a caption", "here", "", None, None, (), reason)


def test_the_report_of_both_methods(koop, folder, stocked):
    done = koop("reproduce", "--json")
    assert done.code == 0, done.err
    found = json.loads(done.out)
    report = folder / found["path"]
    assert report.name == "report.html"
    text = Page(report.read_text())

    assert {figure["figure"] for figure in text.figures} == set(FIGURES) - {
        "best-order",
        "trajectory",
        *OF_BEYOND,
    }  # all but that of --full, and what is drawn of single simulations
    assert [figure["figure"] for figure in text.figures] == [one["figure"] for one in found["figures"]]
    for figure, one in zip(text.figures, found["figures"], strict=True):
        assert figure["command"] == one["command"]
        assert one["caption"] in figure["text"]
        assert one["name"] in figure["text"]
        assert "numpy" in figure["text"]
        assert figure["alt"] == FIGURES[figure["figure"]].about
    assert all(address.startswith(("data:", "#")) for address in text.loaded)  # nothing from elsewhere
    assert str(folder) not in report.read_text()  # and nothing of this machine

    rows = {row[-1]: row for title in text.tables if title.startswith("Every evaluation") for row in text.tables[title]}
    cells = [cell for run in found["runs"] for cell in run["evaluations"]]
    assert len(cells) > 40
    for cell in cells:
        shown = rows[cell["name"]]
        for statistic in ("mean", "std", "median", "max"):
            assert f"{cell['rmse'][statistic]:.4g}" in shown
        assert str(cell["diverged"]) in shown
    (paper,) = (rows for title, rows in text.tables.items() if title.startswith("Eigenfunctions: paper versus here"))
    (headline,) = (c for c in cells if c.get("block") == "headline" and (c["vehicle"], c["seed"]) == ("ctu-2020", 0))
    mean = next(row for row in paper if row[0] == "RMSE")
    assert mean[1] == "23 ± 15 %"
    assert mean[2].startswith(f"{headline['rmse']['mean']:.4g} ± ")

    again = koop("reproduce", "--json")
    assert again.out == done.out
    assert "made in" not in again.err


def test_every_command_of_the_report_makes_its_figure(koop, stocked):
    found = json.loads(koop("reproduce", "edmd", "--set", "plot.restart=2", "--json").out)
    assert {one["run"] for one in found["figures"]} == {"here", "plot.restart=2"}
    commands = [one["command"] for one in found["figures"]]
    assert len(set(commands)) == len(commands)
    assert any("--set plot.restart=2" in command for command in commands)
    for one in found["figures"]:
        program, *words = shlex.split(one["command"])
        assert program == "koop"
        made = koop(*words, "--json", tiny=False)
        assert made.code == 0, made.err
        facts = json.loads(made.out)
        assert (facts["name"], facts["cached"]) == (one["name"], True)


def test_two_runs_share_what_does_not_change(koop, stocked):
    found = json.loads(koop("reproduce", "edmd", "--set", "vehicle.Jzz=1731", "--json").out)
    sketches = [one for one in found["figures"] if one["figure"] == "single-track"]
    assert len(sketches) == 1
    assert [one["run"] for one in found["figures"] if one["figure"] == "density"] == ["here", "vehicle.Jzz=1731"]


def test_what_cannot_be_drawn_does_not_cost_the_report(koop, folder, monkeypatch):
    monkeypatch.setattr(metrics, "diverged", lambda predicted, domain: np.ones(len(predicted), dtype=bool))
    done = koop("reproduce", "edmd", "--json")
    assert done.code == 0, done.err
    assert "the figure 'density' is not drawn" in done.err
    found = json.loads(done.out)
    assert {one["figure"] for one in found["figures"] if one["name"] is None} >= {"density", "orders"}
    assert "Not drawn: every prediction" in (folder / found["path"]).read_text()


def test_texts_are_escaped():
    text = page([section(undrawn("<script>x</script>"))], "koop reproduce --set 'a<b'", "koop 1", None)
    read = Page(text)
    assert read.tables["a <b> & c"] == [["", "paper"], ["row", "1 < 2"], ["\u2003seed 1", "–"]]
    assert read.scripts == 0
    assert "Not drawn: <script>x</script>." in read.figures[0]["text"]


def test_without_the_library_pictures_stand_for_views():
    made = drawing(figure_settings("error-map"), figure_records("error-map"))
    record = type("Record", (), {"name": "plot/1", "provenance": PROVENANCE})()
    one = Illustration("error-map", "balls", "here", "koop plot error-map", made, record, ())
    plain, lively = (page([section(one)], "koop", "koop 1", library) for library in (None, "/* library */"))
    assert Page(plain).scripts == 0
    assert Page(lively).scripts == 3
    for text in (plain, lively):
        assert '<img src="data:image/png;base64,' in text
    assert "commit abc" in plain
    assert "secret" not in plain


PROVENANCE = {
    "time": "2026-01-02T03:04:05.678+00:00",
    "seconds": 0.1,
    "host": "secret",
    "argv": ["secret"],
    "git": "abc",
    "python": "3.11.7",
    "versions": {"koopcli": "0.1.0", "numpy": "2.0"},
}


def test_the_view_holds_every_ball_and_the_trajectories():
    balls = drawing(figure_settings("error-map"), figure_records("error-map"))
    side = drawing(figure_settings("error-side"), figure_records("error-side"))
    lines, points = json.loads(turnable.view(balls, side))["data"]
    rmse = balls.numbers["rmse"].values
    assert points["marker"]["color"] == pytest.approx(rmse.tolist())
    assert points["x"] == pytest.approx(balls.numbers["v_x_0"].values.tolist())
    assert points["z"] == pytest.approx(balls.numbers["yaw_rate_0"].values.tolist())
    assert np.argsort(points["marker"]["size"], kind="stable").tolist() == list(range(len(rmse)))
    assert lines["x"].count(None) == 5  # a gap after each of five trajectories
    assert lines["x"][0] == pytest.approx(side.numbers["training v_x"].values[0], abs=1e-3)
    (alone,) = json.loads(turnable.view(balls, None))["data"]
    assert alone == points


def test_a_view_cannot_end_its_own_script():
    hostile = Drawing("error-map", "png", {}, b"")
    numbers = drawing(figure_settings("error-map"), figure_records("error-map")).numbers
    named = {name.replace("v_x", "</script>"): array for name, array in numbers.items()}
    assert "</script>" not in turnable.view(replace(hostile, numbers=named), None)


def test_the_library_is_whole_and_in_the_page():
    library = turnable.bundle()
    assert library is not None  # the tests' environment has the extra
    assert "newPlot" in library
    assert "</script" not in library
