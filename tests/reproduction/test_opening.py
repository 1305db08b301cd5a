"""The first screen is there whatever is missing, and says what is."""

from __future__ import annotations

from contextlib import nullcontext
from types import SimpleNamespace

import pytest

from koopcli.config.experiment import load_experiment
from koopcli.errors import InvalidValueError
from koopcli.figures.kit.figure import Drawing
from koopcli.reproduction import edmd, eigen
from koopcli.reproduction.illustrations import Illustration, illustrate
from koopcli.reproduction.opening import Part, lead_picture, opening, screen
from koopcli.reproduction.report import Plan, Run, Scored, planned

PLAN = {"orders": [7], "draw_seeds": [0], "excitations": ["fresh", "held"], "seeds": [0], "cuts": [1e-8]}
EXPERIMENT = load_experiment("paper", {"reproduce": PLAN})
NAN = float("nan")


def scores(mean):
    statistics = {"mean": mean, "std": mean / 2, "median": mean, "max": mean}
    return {
        "rmse": statistics,
        "rmse_printed": statistics,
        "rmse_relift": statistics,
        "start_error": {"mean": mean},
        "worst_in_emptiest": 0.5,
        "max_error": {"yaw_rate": 0.0},
        "functions": 27,
        "diverged": 0,
    }


@pytest.fixture(scope="module")
def plans() -> dict[str, Plan]:
    return {method.name: planned(method, Run("here", EXPERIMENT, ())) for method in (edmd.METHOD, eigen.METHOD)}


def part(plan, mean=3.304, drawn=True):
    record = SimpleNamespace(name="evaluate/1", provenance={"time": "2026-11-27T11:00:00+00:00"})
    scored = tuple(Scored(cell, task, scores(mean), record) for cell, task in plan.cells)
    drawing = Drawing("orders", "svg", {}, b"<svg/>") if drawn else None
    pictures = [
        Illustration(one.task.settings.figure, one.caption, "here", "koop", drawing, None, (), "no numbers", one.leads)
        for one in plan.pictures
    ]
    return Part(plan.method, [Run("here", EXPERIMENT, scored)], pictures)


def test_both_methods_have_four_numbers_of_the_tables_scores(plans):
    first = opening([part(plans["edmd"]), part(plans["eigen"], 23.08)], "none", "koop 1")
    assert first.numbers.header[1:3] == ["paper", "here"]
    assert [row[1:] for row in first.numbers.rows] == [
        ["11.1", "3.30 ± 1.7", "%"],
        ["–", "3.30 ± 1.7", "%"],
        ["11.1", "3.30 ± 1.7", "%"],
        ["23 ± 15", "23.1 ± 12", "%"],
    ]
    assert first.about == ["ctu-2020", "computed 2026-11-27", "koop 1"]
    assert first.sentence.count(". ") == 0
    assert "3.30\u00a0%" in first.sentence
    assert "23.1\u00a0%" in first.sentence
    assert first.picture is not None
    assert first.picture.leads
    assert not [text for text in first.missing if "leaves out" in text]


@pytest.mark.parametrize(("name", "other"), [("edmd", "reproduce eigen"), ("eigen", "reproduce edmd")])
def test_one_method_alone_says_what_is_left_out(plans, name, other):
    first = opening([part(plans[name])], "a reason", "koop 1")
    assert 3 <= len(first.numbers.rows) <= 4
    assert [text for text in first.missing if other in text]
    assert [text for text in first.missing if "no ghosts: a reason" in text]


@pytest.mark.parametrize("name", ["edmd", "eigen"])
def test_where_everything_diverges_there_is_a_first_screen(plans, name):
    first = opening([part(plans[name], NAN, drawn=False)], "every prediction diverged", "koop 1")
    html = "".join(screen(first))
    assert first.picture is None
    assert "diverge" in first.sentence
    assert "diverges" in html
    assert "nan" not in html
    assert [text for text in first.missing if "could not be drawn: no numbers" in text]


def test_the_next_best_picture_opens_where_the_leading_one_is_not_drawn():
    drawing = Drawing("orders", "svg", {}, b"<svg/>")
    some = [
        Illustration("orders", "", "here", "", None, None, (), "why", leads=True),
        Illustration("density", "", "here", "", drawing, None, ()),
    ]
    assert lead_picture(some) is some[1]
    assert lead_picture(some[:1]) is None


def test_two_runs_share_what_does_not_change(plans):
    """A picture of both runs is shown once."""
    changed = load_experiment("paper", {"reproduce": PLAN, "vehicle": {"Jzz": 1731.0}})

    def refuse(task):
        raise InvalidValueError("not here")

    reporter = SimpleNamespace(progress=lambda label: nullcontext(lambda done, total: None))
    pipeline = SimpleNamespace(make=refuse, reporter=reporter)
    both = [plans["edmd"], planned(edmd.METHOD, Run("vehicle.Jzz=1731", changed, ()))]
    found = [(one.figure, one.run) for one in illustrate(both, pipeline)]
    assert [run for figure, run in found if figure == "single-track"] == ["here"]
    assert [run for figure, run in found if figure == "density"] == ["here", "vehicle.Jzz=1731"]
