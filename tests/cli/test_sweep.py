"""koop sweep: every combination as ordinary artefacts, resumable, in parts, by workers."""

from __future__ import annotations

import csv
import json

import pytest

from koopcli.stages import fit_edmd
from tests.cli.test_errors import one_line

GRID = ("--set", "fit-edmd.order=1:3", "--set", "sample.seed=0,1")


def cells(result):
    return {tuple(one["settings"].values()): one["name"] for one in json.loads(result.out)["evaluations"]}


def test_every_cell_is_the_artefact_that_the_other_commands_make(koop):
    found = cells(koop("sweep", *GRID, "--json"))
    assert len(found) == 6
    for (order, seed), name in found.items():
        alone = koop("evaluate", "--set", f"fit-edmd.order={order}", "--set", f"sample.seed={seed}")
        assert alone.name == name
        assert "made in" not in "\n".join(line for line in alone.err.splitlines() if line.startswith(name))


def test_it_says_its_name_shows_a_table_and_draws(koop, folder):
    made = koop("sweep", *GRID, "-o", "sweep.png", "--csv", "sweep.csv")
    assert made.code == 0
    assert made.name.startswith("sweep/")
    assert (folder / "sweep.png").read_bytes().startswith(b"\x89PNG")
    rows = list(csv.DictReader((folder / "sweep.csv").read_text().splitlines()))
    assert [(row["fit-edmd.order"], row["sample.seed"]) for row in rows] == [
        (str(order), str(seed)) for order in (1, 2, 3) for seed in (0, 1)
    ]
    assert "seeds" in made.err
    shown = koop("show", made.name, "--csv")
    assert shown.out.splitlines()[1:] == (folder / "sweep.csv").read_text().splitlines()[1:]
    again = koop("sweep", *GRID, "--csv", "-")
    assert again.out == (folder / "sweep.csv").read_text()
    assert made.name in again.err.splitlines()
    assert "made in" not in again.err
    assert koop("plot", "sweep", made.name, "-o", "again.svg").code == 0


@pytest.mark.slow
def test_workers_make_the_same(koop, monkeypatch):
    alone = koop("sweep", *GRID, "--store", "alone", "--json")
    shared = koop("sweep", *GRID, "--store", "shared", "--workers", "2", "--json")
    assert cells(shared) == cells(alone)
    assert json.loads(shared.out)["name"] == json.loads(alone.out)["name"]


def test_shards_together_are_the_whole(koop):
    parts = [cells(koop("sweep", *GRID, "--shard", f"{i}/4", "--json")) for i in range(1, 5)]
    assert sum(map(len, parts)) == 6
    assert all(parts)
    whole = koop("sweep", *GRID, "--json")
    assert cells(whole) == {place: name for part in parts for place, name in part.items()}
    assert "evaluate/" not in "\n".join(line for line in whole.err.splitlines() if "made in" in line)
    refused = koop("sweep", *GRID, "--shard", "7/9")
    one_line(refused, 3, "fewer than 9 cells")


def test_shards_cost_about_the_same():
    from koopcli.config.grids import parse_grid
    from koopcli.stages import grid as grids
    from koopcli.stages.pipeline import cost

    grid = parse_grid(["fit-edmd.order=1:10", "sample.seed=0:5"])
    every = grids.cells(grid, "fit-edmd", "paper", lambda task: None)

    def load(part):
        return sum(cost(cell.task).seconds + cost(cell.task.input("predictor")).seconds for cell in part)

    loads = [load(part) for part in grids.shared_out(every, 4, lambda task: cost(task).seconds)]
    assert max(loads) <= 1.2 * min(loads)


def test_settings_without_effect_are_one_cell(koop):
    """A basis without an order is fitted once, and the order of that cell is left empty."""
    made = koop("sweep", "--set", "fit-edmd.basis=tensor,states", "--set", "fit-edmd.order=1:2", "--json")
    told = [one["settings"] for one in json.loads(made.out)["evaluations"]]
    assert told == [
        {"fit-edmd.basis": "tensor", "fit-edmd.order": "1"},
        {"fit-edmd.basis": "tensor", "fit-edmd.order": "2"},
        {"fit-edmd.basis": "states"},
    ]
    refused = koop("sweep", "--set", "fit-edmd.basis=states", "--set", "fit-edmd.order=1:2")
    assert refused.code == 2
    one_line(refused, 2, "and this basis is 'states'")


def test_cells_that_cannot_work_are_left_out_and_said(koop):
    made = koop("sweep", "--set", "fit-edmd.order=3:6", "--json")
    assert made.code == 0
    said = json.loads(made.out)
    assert [one["settings"]["fit-edmd.order"] for one in said["evaluations"]] == ["3", "4"]
    assert [one["settings"]["fit-edmd.order"] for one in said["refused"]] == ["5", "6"]
    assert "2 of 4 cells cannot work" in made.err
    all_refused = koop("sweep", "--set", "fit-edmd.order=5:6")
    assert all_refused.code == 3
    one_line(all_refused, 3, "too high for 5 values")


def test_cells_that_fail_cost_the_others_nothing(koop, monkeypatch):
    from dataclasses import replace

    from koopcli.errors import InvalidValueError
    from koopcli.stages.registry import STAGES

    real = STAGES["fit-edmd"]

    def run(settings, inputs, context):
        if settings.basis.order == 2:
            raise InvalidValueError("no good")
        return real.run(settings, inputs, context)

    monkeypatch.setitem(STAGES, "fit-edmd", replace(real, run=run))
    made = koop("sweep", "--set", "fit-edmd.order=1:3", "--json")
    assert made.code == 3
    said = json.loads(made.out)
    assert [one["settings"]["fit-edmd.order"] for one in said["evaluations"]] == ["1", "3"]
    assert said["failed"] == [{"settings": {"fit-edmd.order": "2"}, "reason": "no good"}]
    assert "1 of 3 cells failed" in made.err.splitlines()[-1]
    monkeypatch.setitem(STAGES, "fit-edmd", real)
    assert koop("sweep", "--set", "fit-edmd.order=1:3").code == 0


def test_interrupted_it_goes_on(koop, monkeypatch):
    real, done = fit_edmd.STAGE.run, []

    def run(settings, inputs, context):
        if len(done) == 2:
            raise KeyboardInterrupt
        done.append(settings.basis.order)
        return real(settings, inputs, context)

    from dataclasses import replace

    from koopcli.stages.registry import STAGES

    monkeypatch.setitem(STAGES, "fit-edmd", replace(fit_edmd.STAGE, run=run))
    broken = koop("sweep", "--set", "fit-edmd.order=1:4")
    assert broken.code == 130
    assert "run the same command again" in broken.err
    monkeypatch.setitem(STAGES, "fit-edmd", fit_edmd.STAGE)
    again = koop("sweep", "--set", "fit-edmd.order=1:4")
    assert again.code == 0
    assert len([line for line in again.err.splitlines() if line.startswith("fit-edmd/") and "made in" in line]) == 2


@pytest.mark.slow
def test_other_methods_and_vehicles(koop):
    axes = ("--set", "fit-eigen.degree=1:2", "--set", "vehicle.name=ctu-2020,rimac-2018")
    made = koop("sweep", "fit-eigen", *axes, "--json")
    assert made.code == 0
    assert len(cells(made)) == 4
    told = koop("sweep", "baseline", "--set", "baseline.kind=hold,rotation", "--json")
    assert len(cells(told)) == 2


def test_cells_that_come_to_the_same_are_said(koop, folder):
    """A vehicle's tyres do not matter to forces: two names, one artefact."""
    made = koop("sweep", "--set", "vehicle.name=ctu-2020,rimac-2018", "--set", "fit-edmd.order=1:2", "--json")
    assert "2 of 4 cells come to the same as others; the first, vehicle.name=rimac-2018" in made.err
    (same,) = {tuple(one["same"][0].values()) for one in json.loads(made.out)["evaluations"][:1]}
    assert same == ("rimac-2018", "1")


def test_scores_are_written_where_nothing_can_be_drawn(koop, folder):
    """Predictions that all diverge have no error, and no figure."""
    wild = ("--set", "sample.box=[0.01,0.01,0.01]", "--set", "test.box=[300,300,30]", "--set", "fit-edmd.order=3:4")
    made = koop("sweep", *wild, "--csv", "sweep.csv", "-o", "sweep.png")
    assert made.code == 0
    assert "the figure is not drawn" in made.err
    assert "RuntimeWarning" not in made.err
    assert len((folder / "sweep.csv").read_text().splitlines()) == 3
    assert not (folder / "sweep.png").exists()


def test_a_dry_run_makes_nothing(koop, folder):
    planned = koop("sweep", *GRID, "--dry-run", "--json")
    said = json.loads(planned.out)
    assert said["cells"] == 6
    assert said["stages"]["fit-edmd"]["make"] == 6
    assert said["stages"]["sample"]["make"] == 3
    assert not (folder / "artefacts").exists()
    assert "6 cells" in koop("sweep", *GRID, "--dry-run").out


@pytest.mark.parametrize(
    ("args", "code", "words"),
    [
        ((), 2, "what is swept?"),
        (("--set", "fit-edmd.order=2"), 2, "what is swept?"),
        (("--set", "fit-edmd.ordr=1:2"), 2, "did you mean 'order'"),
        (
            ("--set", "fit-edmd.terms=linear,bilinaer"),
            2,
            "'fit-edmd.terms' has no kind 'bilinaer': did you mean 'bilinear'",
        ),
        (("--set", "fit-edmd.order=0:2"), 3, "at least 1, got 0"),
        (("--set", "fit-edmd.order=2:1"), 3, "both ends included"),
        (("--set", "fit-eigen.degree=1:2"), 2, "changes nothing here"),
        (("--set", "vehicle.name=ctu-2020,nobody"), 4, "unknown vehicle 'nobody'"),
        ((*GRID, "--shard", "3"), 2, "I/N"),
        ((*GRID, "--shard", "0/3"), 2, "I/N"),
        ((*GRID, "--shard", "4/3"), 2, "I/N"),
        ((*GRID, "-o", "sweep.bmp"), 3, "unknown ending"),
        ((*GRID, "--workers", "0"), 3, "--workers"),
        ((*GRID, "--workers", "2", "--cluster", "tcp://127.0.0.1:1"), 2, "leave out one of them"),
        (("fit-nothing", *GRID), 2, "fit-nothing"),
    ],
)
def test_wrong_arguments_are_one_line(koop, args, code, words):
    one_line(koop("sweep", *args), code, words)
