from __future__ import annotations

import pytest

from koopcli.config.changes import parse_set
from koopcli.config.experiment import load_experiment
from koopcli.stages import recipes
from koopcli.stages.registry import STAGES


def cost(*assignments):
    return STAGES["evaluate"].estimate(recipes.evaluation(load_experiment("paper", parse_set(assignments))))


def test_the_estimate_knows_the_steps():
    """However few trajectories there are, each step takes its time, and each restart a row."""
    once, longer = (cost("test.count=1", f"test.steps={steps}") for steps in (2_000, 20_000))
    assert longer.seconds == pytest.approx(10 * once.seconds)
    assert longer.bytes == once.bytes
    assert once.seconds > 0.1
    rows = [cost("test.steps=10000", f"evaluate.restart={every}").bytes for every in (1000, 10)]
    assert rows[1] > 5 * rows[0]


@pytest.mark.parametrize(("terms", "times"), [("bilinear", 5), ("generator", 20)])
def test_the_estimate_knows_what_a_step_costs(terms, times):
    small = ["test.count=2000", "test.steps=30", "fit-edmd.order=3"]
    assert cost(*small, f"fit-edmd.terms={terms}").seconds > times * cost(*small).seconds
    steps = cost(*small, f"fit-edmd.terms={terms}", "evaluate.relift=false").seconds
    assert steps == pytest.approx(cost(*small, f"fit-edmd.terms={terms}").seconds / 2, rel=0.2)
