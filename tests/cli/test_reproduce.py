from __future__ import annotations

import json
import re
import shlex

import pytest

from koopcli.cli import reproduce
from koopcli.config.data import data_folder
from koopcli.config.experiment import load_experiment
from koopcli.errors import StorageError
from koopcli.reproduction import edmd
from koopcli.reproduction.opening import Part
from koopcli.reproduction.registry import BEYOND, METHODS
from koopcli.reproduction.report import Run
from koopcli.reproduction.texts import number_text
from koopcli.stages import ahead
from tests import stock
from tests.reproduction.pages import Page

SPLINES = "fit-edmd.basis.thin-plate.centres=9"


def test_the_table_the_report_and_the_pins(koop, folder, stocked):
    done = koop("reproduce", "edmd")
    assert done.code == 0
    report = folder / done.name
    assert report.name == "report.html"
    text = report.read_text()
    for part in (
        "paper",
        "11.1 %",
        "unstated inputs",
        "random 0 draw",
        "even draw",
        "does not hold",
    ):
        assert part in text
    commands = [figure["command"] for figure in Page(text).figures]
    assert "koop plot orders --experiment ../tiny.toml -o orders.svg" in commands
    assert "EDMD: paper versus here" in done.err
    assert "No parameter was chosen" in done.err
    for name in re.findall(r"evaluate/[0-9a-f]{12}", text):
        assert koop("path", name).code == 0
    sweep, others, baselines, forces, more, drawn = 2 * 2 * 2, 2 * 3 * 2, 3 * 2, 2 * 2, 2 * 2, 3
    assert len(set(re.findall(r"evaluate/[0-9a-f]{12}", text))) == sweep + others + baselines + forces + more + drawn
    label = f"reproduce-{report.parent.name}"
    pinned = {row["name"] for row in json.loads(koop("ls", "--json").out) if row["pins"] == [label]}
    planned = json.loads(koop("reproduce", "edmd", "--dry-run", "--json").out)["steps"]
    assert pinned >= {step["name"] for step in planned} > set()
    assert f"pinned as {label}" in done.err
    assert "not of the paper's size" in text


def test_again_from_the_store_without_a_write(koop, folder, stocked):
    first = koop("reproduce", "edmd")
    before = {path: path.stat().st_mtime_ns for path in (folder / "artefacts").rglob("*")}
    again = koop("reproduce", "edmd")
    assert again.out == first.out
    assert "made in" not in again.err
    assert {path: path.stat().st_mtime_ns for path in (folder / "artefacts").rglob("*")} == before


@pytest.mark.slow
def test_one_changed_assumption_beside_the_unmodified_run(koop, folder, stocked):
    few = ["--set", "reproduce.orders=[1]", "--set", "reproduce.excitations=['fresh']", "--json"]
    plain = koop("reproduce", "edmd", *few)
    both = json.loads(koop("reproduce", "edmd", "--set", "vehicle.Jzz=1731", *few).out)
    assert [run["run"] for run in both["runs"]] == ["here", "vehicle.Jzz=1731"]
    assert both["runs"][0]["evaluations"] == json.loads(plain.out)["runs"][0]["evaluations"]
    here, changed = (run["evaluations"] for run in both["runs"])
    sweep, others, baselines, forces, more, drawn = 2, 2 * 3, 3, 2, 2, 3
    assert len(here) == len(changed) == sweep + others + baselines + forces + more + drawn
    free = [a["label"] == "hold the first state" for a in here]
    assert all(a["rmse"] != b["rmse"] for a, b in zip(here, changed, strict=True) if a["order"])
    assert sum(free) == 1
    text = (folder / both["path"]).read_text()
    assert "<em>With vehicle.Jzz=1731.</em>" in text


def test_notes_name_every_amplitude():
    runs = [Run("x", load_experiment("paper", {"test": {"amplitude": value}}), ()) for value in (1e4, 50.0)]
    assert "±10000 or 50 N" in edmd.notes(runs)[0]


def test_the_figures_of_the_report_are_those_of_evaluate(koop, stocked):
    runs = json.loads(koop("reproduce", "edmd", "--json").out)["runs"]
    (cell,) = [
        c
        for c in runs[0]["evaluations"]
        if (c["block"], c["draw"], c["order"], c["excitation"]) == ("sweep", "even", 2, "none")
    ]
    alone = koop("evaluate", "--json", "--set", "sample.draw=even", "--excitation", "none", "--set", "fit-edmd.order=2")
    assert json.loads(alone.out)["rmse"] == cell["rmse"]
    assert json.loads(alone.out)["name"] == cell["name"]


@pytest.mark.parametrize(
    "changes",
    [
        (),
        pytest.param(("fit-edmd.basis=total", "sample.levels=[1,50]"), marks=pytest.mark.slow),
        pytest.param(
            (
                'reproduce.draws=["even"]',
                'reproduce.excitations=["held"]',
                SPLINES,
                "test.amplitude=500",
            ),
            marks=pytest.mark.slow,
        ),
    ],
)
def test_the_commands_of_the_claims_work_and_show_what_they_claim(koop, folder, stocked, changes):
    told = [word for change in changes for word in ("--set", change)]
    done = koop("reproduce", "edmd", *told, "--json")
    report = Page((folder / json.loads(done.out)["path"]).read_text())
    found = {cell["name"] for run in json.loads(done.out)["runs"] for cell in run["evaluations"]}
    (last,) = [rows for title, rows in report.tables.items() if title.startswith("The paper's claims")][-1:]
    assert len(last) == 1 + 3  # its header and what so few orders can judge
    for row in last[1:]:
        words = shlex.split(row[-1])[1:]
        shown = koop(*words, tiny=False)
        assert shown.code == 0, (row[-1], shown.err)
        if words[0] == "evaluate":
            assert shown.name in found


def test_what_is_swept_cannot_be_set(koop):
    for text in ("fit-edmd.order=3", "sample.draw=even", "test.excitation=held"):
        done = koop("reproduce", "edmd", "--set", text)
        assert done.code == 2
        assert "--set 'reproduce." in done.err
    plan = koop("reproduce", "edmd", "--set", " reproduce.orders=[1]", "--set", 'reproduce.draws=["even"]', "--dry-run")
    assert plan.code == 0, plan.err
    assert koop("reproduce", "edmd", "--set", "reproduce.orders=[1, 1]").code == 3


def test_an_impossible_sweep_is_refused_before_anything_is_made(koop, folder):
    assert koop("reproduce", "edmd", "--set", "sample.count=2").code == 3
    assert koop("reproduce", "edmd", "--set", "sample.grid.count=2").code == 3
    assert not (folder / "artefacts").exists()


def test_dry_run_and_smoke(koop, folder):
    plan = json.loads(koop("reproduce", "edmd", "--smoke", "--dry-run", "--json", tiny=False).out)
    assert (
        sum(step["name"].startswith("evaluate") for step in plan["steps"])
        == 4 * 3 * 3 + 2 * 3 * 3 + 3 * 3 + 2 * 3 + 2 * 3 + 3
    )
    assert (
        sum(step["name"].startswith("sample") for step in plan["steps"]) == 4 + 6 + 1
    )  # training, test inputs in a box and on a grid, the random-input figure
    assert not (folder / "artefacts").exists()
    assert koop("reproduce", "edmd", "--smoke").code == 2  # with an experiment of its own
    assert (data_folder() / "experiments" / "smoke.toml").is_file()


def test_the_eigenfunction_tables(koop, folder, stocked):
    done = koop("reproduce", "eigen", "--json")
    assert done.code == 0, done.err
    (run,) = json.loads(done.out)["runs"]
    assert run["method"] == "eigen"
    cells = {(c["block"], c["label"], c["vehicle"], c["seed"]): c for c in run["evaluations"]}
    assert len(cells) == len(run["evaluations"])
    blocks = {block for block, *_ in cells}
    assert blocks == {"headline", "readings", "cuts", "grip", "baselines"}
    for vehicle in ("ctu-2020", "rimac-2018"):
        assert ("headline", "as the experiment says", vehicle, 0) in cells
        assert ("baselines", "DMD", vehicle, 0) in cells
    text = (folder / json.loads(done.out)["path"]).read_text()
    headline = cells["headline", "as the experiment says", "ctu-2020", 0]
    assert f"{number_text(headline['rmse']['mean'])} ± " in done.err
    assert number_text(headline["start_error"]["mean"]) in done.err
    for part in ("23 ± 15", "rimac-2018", "cut 1e-08", "grip × 2", "optimal, cut 1e-10, D = 7800 N", "error-map"):
        assert part in text
    assert "not of the paper's size" in done.err


@pytest.mark.slow
def test_a_changed_eigenfunction_run_beside_the_plain_one(koop, stocked):
    done = koop("reproduce", "eigen", "--set", "vehicle.mu_scale=2", "--json")
    plain, changed = json.loads(done.out)["runs"]
    assert changed["run"] == "vehicle.mu_scale=2"
    assert "rimac-2018, vehicle.mu_scale=2" in done.err
    doubled = {
        c["label"]: c["rmse"] for c in plain["evaluations"] if c["block"] == "grip" and c["vehicle"] == "ctu-2020"
    }
    (headline,) = [
        c["rmse"]
        for c in changed["evaluations"]
        if (c["block"], c["vehicle"], c["seed"]) == ("headline", "ctu-2020", 0)
    ]
    assert headline == doubled["grip × 2"]


@pytest.mark.slow
def test_both_methods_share_one_report_and_a_change_goes_where_it_belongs(koop, folder, stocked):
    done = koop("reproduce", "--set", "vehicle.lateral.mu=1.5", "--json")
    found = json.loads(done.out)
    assert [(run["method"], run["run"]) for run in found["runs"]] == [
        ("edmd", "here"),
        ("eigen", "here"),
        ("eigen", "vehicle.lateral.mu=1.5"),
    ]
    text = (folder / found["path"]).read_text()
    assert text.index("<h2>EDMD</h2>") < text.index("<h2>Eigenfunctions</h2>")
    runs = {(one["method"], one["figure"], one["run"]) for one in found["figures"]}
    assert ("eigen", "error-map", "vehicle.lateral.mu=1.5") in runs
    assert ("edmd", "orders", "vehicle.lateral.mu=1.5") not in runs


def cells(done, block):
    (run,) = [run for run in json.loads(done.out)["runs"] if run["run"] == "here"]
    return {(c["label"], c["vehicle"]): c["rmse"]["mean"] for c in run["evaluations"] if c["block"] == block}


@pytest.mark.slow
def test_vehicles_keep_apart_whatever_they_are_called(koop, folder, stocked):
    """One that is changed in the file beside its namesake as shipped; one file under another path only once."""
    text = (folder.parent / "tiny.toml").read_text().replace("seeds = [0, 1]", "seeds = [0]")
    mine = folder / "mine.toml"
    mine.write_text('[vehicle]\nname = "rimac-2018"\nJzz = 1731.0\n' + text)
    done = koop("reproduce", "eigen", "--experiment", "mine.toml", "--json", tiny=False)
    assert done.code == 0, done.err
    found = cells(done, "baselines")
    labels = {vehicle for _, vehicle in found}
    assert labels == {"rimac-2018", "rimac-2018 as its file has it"}
    rotation = "rotation at the first yaw rate"
    assert found[rotation, "rimac-2018"] != found[rotation, "rimac-2018 as its file has it"]
    assert number_text(found[rotation, "rimac-2018 as its file has it"]) in done.err
    assert "is met on the later tyre" not in done.err  # that is said of the paper's reading and size alone
    mine.write_text('[vehicle]\nname = "rimac-2018"\n' + text)
    once = koop("reproduce", "eigen", "--experiment", "mine.toml", "--json", tiny=False)
    assert {vehicle for _, vehicle in cells(once, "baselines")} == {"rimac-2018"}


def test_a_vehicle_file_beside_from_where_it_was_named(koop, folder):
    text = (data_folder() / "vehicles" / "ctu-2020.toml").read_text()
    (folder / "heavy.toml").write_text(text.replace("1300.0", "2600.0"))
    plan = ["--set", "reproduce.seeds=[0]", "--set", "reproduce.cuts=[1e-8]"]
    done = koop("reproduce", "eigen", "--set", 'reproduce.beside=["./heavy.toml"]', *plan, "--dry-run", "--json")
    assert done.code == 0, done.err
    steps = [step["settings"] for step in json.loads(done.out)["steps"] if step["name"].startswith("sample")]
    masses = {settings["m"] for settings in steps if "m" in settings}  # of samples on surfaces and in volumes
    assert masses == {1300.0, 2600.0}
    assert koop("reproduce", "eigen", "--set", "reproduce.beside=[]", *plan, "--dry-run", "--json").code == 0


def test_the_baselines_of_one_method_ignore_the_settings_of_the_other(koop, folder):
    """EDMD beside eigenfunctions is EDMD of the order that its row names."""
    text = (folder.parent / "tiny.toml").read_text().replace("order = 2", 'basis.kind = "states"')
    (folder / "mine.toml").write_text(text)
    plan = koop("reproduce", "eigen", "--experiment", "mine.toml", "--dry-run", "--json", tiny=False)
    fits = [s["settings"] for s in json.loads(plan.out)["steps"] if s["name"].startswith("fit-edmd")]
    assert {(fit["basis"], fit.get("order")) for fit in fits} == {("states", None), ("tensor", 3), ("tensor", 5)}


def test_an_interrupted_run_has_a_report_of_what_there_is(koop, folder, reproduced, monkeypatch):
    """All of EDMD and no eigenfunctions, and no figure."""

    def stop(*_):
        raise KeyboardInterrupt

    stock.link(reproduced, folder / "artefacts", without=["fit-eigen", "plot"])
    monkeypatch.setattr(ahead, "make_ahead", stop)
    done = koop("reproduce")
    assert (done.code, done.out) == (130, "")
    *_, told, last = done.err.splitlines()
    assert last.endswith("run the same command again to resume")
    text = (folder / told.rpartition(": ")[2]).read_text()
    page = Page(text)
    assert next(row[2] for row in page.tables[""] if row[0].startswith("EDMD")).count("±") == 1
    assert re.search(r"interrupted: [1-9]\d* of [1-9]\d* evaluations of eigenfunctions are here", text)
    assert page.figures == []
    assert "could not be drawn: the run was interrupted" in text
    assert any(title.startswith("EDMD: paper versus here") for title in page.tables)  # nothing of it is missing
    assert not any(title.startswith("Eigenfunctions: paper") for title in page.tables)

    def refuse(*_):
        raise StorageError("the disk is full")

    monkeypatch.setattr(reproduce, "_write_report", refuse)
    assert koop("reproduce").code == 130  # an interrupt, whatever becomes of the report


def test_what_is_measured_in_a_run_is_missing_where_it_stopped():
    """A stopped run measures nothing, so what goes beyond the paper has no tables even with all scores there."""
    run = Run("here", load_experiment("smoke", {}), ())
    assert Part(METHODS["edmd"], [run], [], planned=0).whole
    assert Part(BEYOND, [run], []).whole
    assert not Part(BEYOND, [run], [], planned=0).whole
