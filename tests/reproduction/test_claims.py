"""Verdicts follow from the figures, whichever they are."""

from __future__ import annotations

import math
import shlex
from dataclasses import replace
from types import SimpleNamespace

import pytest

from koopcli.config.experiment import load_experiment
from koopcli.reproduction import edmd_cells as blocks
from koopcli.reproduction.claims import CLAIMS, claims_table
from koopcli.reproduction.report import Run, Scored

EXPERIMENT = load_experiment("paper", {"reproduce": {"excitations": ["fresh", "held"]}})
TEXTS = {
    "floor": "an error of 11.1 % is the best there is",
    "splines": "polynomials beat thin-plate splines",
    "best": "orders 6 and 7 are best",
    "larger": "larger bases get worse",
    "forces": "small training forces beat large ones",
    "yaw": "the yaw rate is tracked without error",
}

SPLINES = "fit-edmd.basis.thin-plate.centres=9"


def figures(mean=3.0, yaw=1e-12, diverged=0, functions=27):
    return {"rmse": {"mean": mean}, "max_error": {"yaw_rate": yaw}, "diverged": diverged, "functions": functions}


def run_with(error, experiment=EXPERIMENT, label="here", changes=()):
    """A run whose every cell scores what ``error(cell)`` says: a mean, or all figures."""
    scored = []
    for cell, task in blocks.cells(experiment):
        found = error(cell)
        score = found if isinstance(found, dict) else figures(found)
        scored.append(Scored(cell, task, score, SimpleNamespace(name="x")))
    return Run(label, experiment, tuple(scored), changes=changes)


def verdicts(run):
    rows = claims_table(run).rows
    return {name: row[3] for name, text in TEXTS.items() for row in rows if row[0] == text}


def falling(cell):
    """Orders that get better and stay, splines and bilinear terms as they are."""
    if cell.label.startswith("bilinear"):
        return 0.1
    if cell.order is None:
        return 20.0
    return max(3.0, 10.0 - cell.order) * (1 if cell.order <= 7 else 1.001)


def test_the_table_has_every_claim_with_a_command():
    table = claims_table(run_with(falling))
    assert [row[0] for row in table.rows] == list(TEXTS.values()) == [claim.text for claim in CLAIMS]
    assert all(row[4].startswith("koop ") for row in table.rows)


def test_what_the_paper_says_where_it_holds():
    found = verdicts(run_with(falling))
    assert found["floor"].startswith("does not hold: bilinear terms are 111 times better with 27 functions")
    assert found["splines"] == "holds"
    assert found["best"] == "holds; within 2 % of the best in 4 of 4"
    assert found["larger"].startswith("does not hold")
    assert found["forces"] == "does not hold"
    assert found["yaw"] == "holds, to rounding"


@pytest.mark.parametrize(
    ("claim", "error", "verdict"),
    [
        ("floor", lambda c: 12.0, "holds"),
        ("splines", lambda c: 1.0 if c.block == blocks.OTHERS and c.order is None else 3.0, "does not hold"),
        (
            "splines",
            lambda c: {"even": 1.0}.get(c.draw, 9.0) if c.block == blocks.OTHERS and c.order is None else 3.0,
            "holds in 1 of 2 cases",
        ),
        ("best", lambda c: 1.0 if c.order == 3 else 3.0, "does not hold; within 2 % of the best in 0 of 4"),
        (
            "best",
            lambda c: {"random 2": 1.0}.get(c.draw, 3.0) if c.order in (6, 7) else 2.0,
            "holds in 1 of 4 cases; within 2 % of the best in 1 of 4",
        ),
        ("larger", lambda c: 9.0 if c.order == 10 and c.draw == "random 2" else 3.0, "holds in 1 of 4 cases"),
        ("forces", lambda c: 9.0 if c.block == blocks.FORCES and "10000" in c.label else 3.0, "holds"),
        ("yaw", lambda c: figures(yaw=1e-3 if c.draw == "even" else 1e-12), "holds in 3 of 4 cases"),
    ],
)
def test_a_verdict_follows_the_figures(claim, error, verdict):
    assert verdicts(run_with(error))[claim].startswith(verdict)


def test_predictions_that_diverge_are_the_worst_there_are():
    """Those left are no mean to boast of."""

    def error(cell):
        return figures(mean=math.nan, diverged=3375) if cell.order == 10 else figures(3.0)

    found = run_with(error)
    assert verdicts(found)["larger"].startswith("holds")
    (row,) = [row for row in claims_table(found).rows if row[0] == TEXTS["larger"]]
    assert "diverges (order 10)" in row[2]


def test_growth_of_the_textbooks_regression_is_said_to_be_rounding():
    def error(cell):
        return 250.0 if cell.block == blocks.TEXTBOOK and cell.order == 7 else 3.0

    assert "rounding" in verdicts(run_with(error))["larger"]
    assert "rounding" not in verdicts(run_with(lambda c: 3.0))["larger"]


def test_many_draws_are_counted():
    experiment = load_experiment("paper", {"reproduce": {"full": True, "full_draws": 5, "excitations": ["fresh"]}})

    def error(cell):
        best = {"random 3": 9, "random 4": 8}.get(cell.draw, 6)
        return 1.0 if cell.order == best else 3.0

    run = run_with(error, experiment)
    (row,) = [row for row in claims_table(run).rows if row[0] == TEXTS["best"]]
    assert "over 5 random draws: 6 in 3, 8 in 1, 9 in 1" in row[2]
    assert row[3].endswith("6 to 8 in 4 of 5")


def test_claims_that_a_smaller_sweep_cannot_judge_are_left_out():
    experiment = load_experiment("paper", {"reproduce": {"orders": [2, 3], "training_forces": [1e4]}})
    assert set(verdicts(run_with(lambda c: 3.0, experiment))) == {"floor", "splines", "yaw"}


def test_commands_say_what_the_run_changed():
    changes = (
        "reproduce.orders=[6]",
        "vehicle.Jzz=1731",
        SPLINES,
        "test.amplitude=5",
        "plot.restart=9",
    )
    run = replace(run_with(falling), base="./mine.toml", changes=changes)
    table = claims_table(replace(run, label="vehicle.Jzz=1731"))
    assert table.title == "The paper's claims, with vehicle.Jzz=1731"
    said = [set(shlex.split(row[4])) for row in table.rows]
    assert all({"--experiment", "./mine.toml", "vehicle.Jzz=1731"} <= words for words in said)
    kept = [[name in words for name in changes] for words in said]
    assert kept == [
        [False, True, False, True, False],
        [False, True, True, True, False],
        [True, True, False, True, False],
        [False, True, False, True, False],
        [False, True, False, True, False],
        [False, True, False, False, True],
    ]
