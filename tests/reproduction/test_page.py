"""The report as a page: complete, self-contained, and true to the numbers of `--json`."""

from __future__ import annotations

import io
import json
import shlex
from dataclasses import replace
from urllib.parse import unquote

import numpy as np
import pytest
from PIL import Image

from koopcli.figures.kit.figure import Drawing, drawing
from koopcli.figures.kit.registry import FIGURES
from koopcli.koopman.scores import metrics
from koopcli.reproduction.illustrations import Illustration
from koopcli.reproduction.images import address, shrunk
from koopcli.reproduction.opening import Opening
from koopcli.reproduction.page import Section, page
from koopcli.reproduction.report import Table
from koopcli.reproduction.texts import number_text
from tests.reproduction.pages import Page
from tests.stages.toys import figure_records, figure_settings

TABLE = Table("a <b> & c", ["", "paper"], [["row", "1 < 2"], ["  seed 1", "–"]])

SHOWN = {
    *("orders", "sweep", "random-input", "spectrum"),
    *("energy-surface", "error-map", "error-side", "density", "rmse-histogram", "mean-trajectory"),
    *("horizon", "compare", "single-track", "tyre"),
}  # figures of a report without --full and --beyond


def section(*illustrations):
    return Section("edmd", "EDMD", [TABLE], ["a note"], illustrations, replace(TABLE, title="every"))


def first(picture=None):
    return Opening("A sentence.", ["ctu-2020"], TABLE, picture, "no <ghosts>", ["There are no <ghosts>."])


def undrawn(reason="every prediction diverged"):
    return Illustration("orders", "a caption", "here", "", None, None, (), reason)


def test_the_report_of_both_methods(koop, folder, stocked):
    done = koop("reproduce", "--json")
    assert done.code == 0, done.err
    found = json.loads(done.out)
    report = folder / found["path"]
    assert report.name == "report.html"
    text = Page(report.read_text())

    assert {figure["figure"] for figure in text.figures} == SHOWN
    assert len(text.figures) == len(found["figures"])
    for one in found["figures"]:
        (figure,) = [figure for figure in text.figures if one["name"] in figure["text"]]
        assert figure["command"] == one["command"]
        assert one["caption"] in figure["text"]
        assert "numpy" in figure["text"]
        assert figure["alt"] == FIGURES[figure["figure"]].about
    assert text.figures[0]["figure"] == "orders"  # on the first screen
    assert report.stat().st_size < 3_000_000
    assert all(address.startswith(("data:", "#")) for address in text.loaded)  # nothing from elsewhere
    assert str(folder) not in report.read_text()  # and nothing of this machine

    rows = {row[-1]: row for title in text.tables if title.startswith("Every evaluation") for row in text.tables[title]}
    cells = [cell for run in found["runs"] for cell in run["evaluations"]]
    assert len(cells) > 40
    for cell in cells:
        shown = rows[cell["name"]]
        for statistic, digits in (("mean", 3), ("std", 2), ("median", 3), ("max", 3)):
            assert number_text(cell["rmse"][statistic], digits) in shown
        assert str(cell["diverged"]) in shown
    (paper,) = (rows for title, rows in text.tables.items() if title.startswith("Eigenfunctions: paper versus here"))
    (headline,) = (c for c in cells if c.get("block") == "headline" and (c["vehicle"], c["seed"]) == ("ctu-2020", 0))
    mean = next(row for row in paper if row[0] == "RMSE")
    assert mean[1] == "23 ± 15"
    assert mean[2].startswith(f"{number_text(headline['rmse']['mean'])} ± ")
    assert mean[-1] == "%"
    (opening,) = [row for row in text.tables[""] if row[0] == "eigenfunctions, ctu-2020"]
    assert mean[2].startswith(opening[2])  # the same score


@pytest.mark.slow
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


@pytest.mark.slow
def test_what_cannot_be_drawn_does_not_cost_the_report(koop, folder, monkeypatch):
    monkeypatch.setattr(metrics, "diverged", lambda predicted, domain: np.ones(len(predicted), dtype=bool))
    few = ("reproduce.orders=[1]", "reproduce.excitations=['fresh']", "reproduce.draws=['even']")
    done = koop("reproduce", "edmd", "--json", *(word for change in few for word in ("--set", change)))
    assert done.code == 0, done.err
    assert "the figure 'density' is not drawn" in done.err
    found = json.loads(done.out)
    assert {one["figure"] for one in found["figures"] if one["name"] is None} >= {"density", "orders"}
    text = (folder / found["path"]).read_text()
    assert "Not drawn: every prediction" in text
    assert "could not be drawn: every prediction" in text  # said on the first screen
    assert "diverges" in text


def test_texts_are_escaped():
    text = page(first(), [section(undrawn("<script>x</script>"))], "koop reproduce --set 'a<b'", "koop 1")
    read = Page(text)
    assert read.tables["a <b> & c"] == [["", "paper"], ["row", "1 < 2"], ["\u2003seed 1", "–"]]
    assert read.scripts == 2  # the page's own
    assert "no &lt;ghosts&gt;" in text
    assert "Not drawn: <script>x</script>." in read.figures[0]["text"]


def test_where_a_picture_comes_from():
    made = drawing(figure_settings("error-map"), figure_records("error-map"))
    record = type("Record", (), {"name": "plot/1", "provenance": PROVENANCE})()
    one = Illustration("error-map", "balls", "here", "koop plot error-map --set a.b=1", made, record, ())
    text = page(first(one), [section(one)], "koop", "koop 1")
    assert text.count('<img src="data:image/png;base64,') == 1  # on the first screen, and nowhere else
    assert "commit abc" in text
    assert "secret" not in text
    assert "<span>--set</span> <span>a.b=1</span>" in text  # breaks between words alone


def test_a_picture_in_few_bytes_is_the_same_picture():
    made = drawing(figure_settings("error-side"), figure_records("error-side"))
    small = shrunk(made.image)
    assert len(small) < 0.6 * len(made.image)
    before, after = (np.asarray(Image.open(io.BytesIO(png)).convert("RGB"), dtype=int) for png in (made.image, small))
    assert before.shape == after.shape
    assert np.abs(before - after).mean() < 2  # of 255


def test_a_picture_of_lines_survives_as_an_address():
    made = Drawing(
        "orders", "svg", {}, b'<?xml version="1.0"?>\n<svg a="1">\n<path d="M 0 1\nL 2 3"/><!-- 5 % # --></svg>'
    )
    told = address(made)
    assert not set('"<>#\n') & set(told)
    assert unquote(told.partition(",")[2]) == '<svg a="1"> <path d="M 0 1 L 2 3"/><!-- 5 % # --></svg>'


PROVENANCE = {
    "time": "2026-01-02T03:04:05.678+00:00",
    "seconds": 0.1,
    "host": "secret",
    "argv": ["secret"],
    "git": "abc",
    "python": "3.11.7",
    "versions": {"koopcli": "0.1.0", "numpy": "2.0"},
}
