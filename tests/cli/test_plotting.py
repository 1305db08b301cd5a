from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from koopcli.config.data import data_folder
from koopcli.figures.kit.registry import FIGURES
from koopcli.koopman.scores import metrics
from tests.cli.test_errors import one_line

SHORT = ("error-map", "orders", "random-input", "spectrum")  # one of each kind of what figures take
TAKING = [name for name, kind in FIGURES.items() if kind.takes != "nothing"]


def in_time(names, *long):
    """The names of figures as parameters, of which the ``long`` ones are slow."""
    return [pytest.param(name, marks=pytest.mark.slow) if name in long else name for name in names]


def inputs_of(koop, name):
    """The artefacts that a figure draws, by name."""
    record = json.loads(koop("show", name, "--json").out)
    kind = FIGURES[record["settings"]["plot"]["figure"]]
    role = kind.roles[0]
    return [record["inputs"][f"{i}/{role}"] for i in range(sum(key.endswith(f"/{role}") for key in record["inputs"]))]


@pytest.mark.parametrize("name", in_time(FIGURES, *(set(FIGURES) - {*SHORT, "tyre"})))
def test_a_figure_named_alone_makes_what_it_needs(koop, folder, undrawn, name):
    done = koop("plot", name, "-o", "figure.png", "--csv", "figure.csv", "--json")
    assert done.code == 0, done.err
    facts = json.loads(done.out)
    assert (facts["figure"], facts["cached"]) == (name, False)
    assert (folder / "figure.png").read_bytes().startswith(b"\x89PNG")
    with (folder / "figure.csv").open(newline="") as file:
        header, *rows = csv.reader(file)
    assert all(column.endswith(")") for column in header)
    assert rows
    assert koop("show", facts["name"], "--csv").out.replace("\r", "") == (folder / "figure.csv").read_text()
    again = json.loads(koop("plot", name, "-o", "again.png", "--json").out)
    assert again["cached"]
    assert again["name"] == facts["name"]
    assert (folder / "again.png").read_bytes() == (folder / "figure.png").read_bytes()


@pytest.mark.parametrize("name", in_time(TAKING, *(set(TAKING) - set(SHORT))))
def test_named_artefacts_are_the_same_figure(koop, stocked, name):
    alone = koop("plot", name)
    named = koop("plot", name, *inputs_of(koop, alone.name))
    assert named.code == 0, named.err
    assert named.name == alone.name
    assert "add -o FILE" in named.err


def test_every_format(koop, folder):
    names = set()
    for ending, head in ((".png", b"\x89PNG"), (".SVG", b"<?xml"), (".pdf", b"%PDF")):
        done = koop("plot", "single-track", "-o", f"sketch{ending}")
        assert done.code == 0
        names.add(done.name)
        assert (folder / f"sketch{ending}").read_bytes().startswith(head)
    assert len(names) == 3


def test_the_list_says_what_each_takes(koop):
    listed = koop("plot", "--list").out
    for name, kind in FIGURES.items():
        assert name in listed
        assert kind.about in listed
    assert "sample of kind ellipsoid" in listed
    assert json.loads(koop("plot", "--list", "--json").out)["spectrum"]["takes"] == "fit"


def test_the_numbers_are_those_of_the_evaluation(koop, folder):
    evaluation = koop("evaluate", koop("fit-eigen").name).name
    koop("plot", "error-map", evaluation, "--csv", "map.csv")
    with (folder / "map.csv").open(newline="") as file:
        drawn = sorted(float(row["rmse (%)"]) for row in csv.DictReader(file))
    table = csv.DictReader(koop("show", evaluation, "--csv").out.splitlines())
    assert drawn == sorted(float(row["rmse (%)"]) for row in table)


def test_a_dry_run_makes_nothing(koop, folder):
    plan = json.loads(koop("plot", "compare", "--dry-run", "--json").out)
    assert {step["action"] for step in plan["steps"]} == {"make"}
    assert sum(step["name"].startswith("evaluate") for step in plan["steps"]) == 7
    assert not (folder / "artefacts").exists()


def test_one_changed_assumption(koop):
    for name, change in (
        ("tyre", "vehicle.mu_scale=0.5"),
        ("tyre", "reproduce.beside=[]"),
        ("random-input", "plot.restart=7"),
        ("random-input", "test.point.seed=3"),
        ("random-input", "vehicle.Jzz=1731"),
        ("random-input", "simulate.force_per=wheel"),
        ("energy-surface", "sample.mesh=fibonacci"),
        ("energy-surface", "vehicle.Jzz=1731"),
        ("horizon", "fit-eigen.boundary=optimal"),
        ("spectrum", "fit-edmd.order=1"),
    ):
        plans = [koop("plot", name, *more, "--dry-run", "--json") for more in ((), ("--set", change))]
        plain, changed = (json.loads(plan.out)["steps"] for plan in plans)
        assert changed != plain, change


@pytest.mark.parametrize(
    ("name", "change", "part"),
    [
        ("tyre", "vehicle.Jzz=1731", "the figure 'tyre' draws nothing of it"),
        ("single-track", "vehicle.Jzz=1731", "the figure 'single-track' draws nothing of it"),
        ("orders", "fit-edmd.order=3", "it sweeps reproduce.orders"),
        ("best-order", "sample.seed=3", "over reproduce.full_draws random grids"),
        ("tyre", "fit-edmd.order=3", "the figure 'tyre' draws nothing of it"),
        ("tyre", "sample.seed=3", "the figure 'tyre' draws nothing of it"),
        ("single-track", "vehicle.mu_scale=0.5", "changes nothing"),
        ("single-track", "plot.restart=7", "draws nothing of it"),
        ("error-map", "plot.restart=7", "draws nothing of it"),
        ("error-map", "test.point.seed=7", "no test of kind 'point' is used"),
        ("compare", "fit-edmd.order=3", "fixed baselines"),
        ("compare", "baseline.kind=rotation", "fixed baselines"),
        ("spectrum", "test.box.seed=2", "no test of kind 'box'"),
        ("spectrum", "test.seed=2", "draws nothing of it"),
        ("random-input", "test.seed=2", "draws nothing of it"),  # it is of its own kind, whichever is in use
        ("random-input", "test.box.seed=2", "no test of kind 'box' is used"),
        ("orders", "reproduce.seeds=[1]", "draws nothing of it"),
    ],
)
def test_a_setting_without_effect_is_refused(koop, folder, name, change, part):
    one_line(koop("plot", name, "--set", change), 2, part)
    assert not (folder / "artefacts").exists()


def test_the_wrong_kind_of_artefact_and_which_kinds_are_taken(koop):
    sample, predictor, baseline = koop("sample").name, koop("fit-edmd").name, koop("baseline", "hold").name
    one_line(koop("plot", "error-map", predictor), 4, "what 'error-map' draws must be of stage evaluate")
    one_line(koop("plot", "random-input", sample), 4, "must be of stage fit-edmd or fit-eigen or baseline")
    one_line(koop("plot", "spectrum", baseline), 4, "must be of stage fit-edmd or fit-eigen")
    one_line(koop("plot", "energy-surface", sample), 4, "is a sample of kind 'grid'", "those of kind ellipsoid")
    one_line(koop("plot", "tyre", sample), 2, "draws no artefact")
    one_line(koop("plot", "density", "evaluate/12345"), 4, "koop ls")
    evaluations = [koop("evaluate", "--set", f"fit-edmd.order={order}").name for order in (1, 2)]
    one_line(koop("plot", "density", *evaluations), 3, "draws one evaluation, got 2")


def test_predictors_that_do_not_share_a_test_set(koop):
    predictor = koop("fit-edmd").name
    one, other = koop("evaluate", predictor).name, koop("evaluate", predictor, "--seed", "3").name
    for name in ("compare", "horizon", "rmse-histogram"):
        result = koop("plot", name, one, other)
        one_line(result, 3, "on one test set", one, other, "evaluate each predictor with --on simulate/")
    from_start = koop("evaluate", predictor, "--set", "evaluate.first=0").name
    one_line(koop("plot", "compare", one, from_start), 3, "from k = 0", "evaluate.first")
    one_line(koop("plot", "compare", one, one), 3, f"{one} is named twice")
    sliding = koop("evaluate", koop("fit-eigen").name).name
    one_line(koop("plot", "compare", one, sliding), 3, "is of the plant 'forces'", "predictors of one plant")


def test_predictors_of_one_name_are_told_apart_by_their_settings(koop, folder):
    fits = [koop("fit-eigen", "--boundary", "optimal", "--cut", cut).name for cut in ("1e-6", "1e-8")]
    evaluations = [koop("evaluate", fit).name for fit in fits]
    assert koop("plot", "compare", *evaluations, "--csv", "side.csv").code == 0
    header = (folder / "side.csv").read_text().splitlines()[0]
    assert "eigenfunctions, optimal, cut 1e-06/rmse (%)" in header
    assert "eigenfunctions, optimal, cut 1e-08/rmse (%)" in header


def test_the_random_input_figure_is_of_plants_driven_by_forces(koop):
    one_line(
        koop("plot", "random-input", koop("fit-eigen").name), 3, "takes predictors of the plant 'forces', fit-eigen/"
    )
    predictor = koop("fit-edmd").name
    told = koop("plot", "random-input", predictor, "--set", "plot.restart=3", "--set", "test.point.seed=4")
    assert told.code == 0
    one_line(koop("plot", "random-input", predictor, "--set", "fit-edmd.order=1"), 2, "is made already")
    one_line(
        koop("plot", "random-input", "--set", "test.point.x0=[1, 2]"), 3, "one value for each of v_x, v_y, yaw_rate"
    )
    one_line(koop("plot", "random-input", "--set", "plot.restart=0"), 3, "'plot.restart' must be at least 1")


def test_a_vehicle_without_tyres_has_none_to_draw(koop, folder):
    text = (data_folder() / "vehicles" / "ctu-2020.toml").read_text()
    (folder / "bare.toml").write_text(text[: text.index("[lateral]")])
    one_line(koop("plot", "tyre", "--set", "vehicle.name=./bare.toml"), 3, "bare has no tyres", "[lateral]")


@pytest.mark.parametrize(
    ("stem", "changed"),
    [
        ("x$\\foo$", "vehicle.mu_scale=0.5"),
        ("_car", "vehicle.l_f=1.0"),
        ("a$b$c^", "vehicle.l_f=1.0"),
        ("a-very-" + 8 * "long-" + "name-of-a-vehicle", "vehicle.mu_scale=0.5"),
    ],
)
def test_whatever_a_vehicle_is_called(koop, folder, stem, changed):
    text = (data_folder() / "vehicles" / "ctu-2020.toml").read_text()
    (folder / f"{stem}.toml").write_text(text)
    done = koop("plot", "tyre", "--set", f"vehicle.name=./{stem}.toml", "--set", changed)
    assert done.code == 0, done.err


def test_an_evaluation_where_everything_diverged(koop, monkeypatch):
    monkeypatch.setattr(metrics, "diverged", lambda predicted, domain: np.ones(len(predicted), dtype=bool))
    evaluation = koop("evaluate").name
    for name, kind in FIGURES.items():
        if kind.takes == "evaluation" and kind.against != "modes":  # which EDMD does not have
            one_line(koop("plot", name, evaluation), 3, "diverged: there is no error to draw")


def test_the_numbers_come_in_the_order_they_are_drawn_in(koop, folder):
    koop("plot", "random-input", "--csv", "one.csv")
    header = (folder / "one.csv").read_text().splitlines()[0].split(",")
    assert [name.split(" (")[0] for name in header[:4]] == ["time", "v_x/true", "v_y/true", "yaw_rate/true"]


def test_a_link_stays_a_link_and_a_device_a_device(koop, folder):
    (folder / "real.png").write_bytes(b"old")
    (folder / "link.png").symlink_to("real.png")
    assert koop("plot", "tyre", "-o", "link.png").code == 0
    assert (folder / "link.png").is_symlink()
    assert (folder / "real.png").read_bytes().startswith(b"\x89PNG")
    assert koop("plot", "tyre", "--csv", "/dev/null").code == 0
    assert Path("/dev/null").is_char_device()


def test_where_an_image_cannot_be_written(koop, folder):
    (folder / "taken").mkdir()
    closed = folder / "closed"
    closed.mkdir(mode=0o555)
    for option, ending in (("-o", ".png"), ("--csv", ".csv")):
        one_line(koop("plot", "tyre", option, f"no/such/folder/x{ending}"), 6, "no/such/folder")
        one_line(koop("plot", "tyre", "-o", "taken"), 3, "unknown ending")
    one_line(koop("plot", "tyre", "--csv", "taken"), 6, "name a file")
    one_line(koop("plot", "tyre", "-o", "x.png", "--csv", "./x.png"), 2, "x.png cannot be both")
    assert not (folder / "artefacts").exists()
