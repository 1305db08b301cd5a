"""What is said to a predictor that does not beat its baselines, as far as it depends on settings alone."""

from __future__ import annotations

from dataclasses import replace

import pytest

from koopcli.config.experiment import load_experiment
from koopcli.koopman.edmd.fit import FitEdmd
from koopcli.koopman.eigen.fit import FitEigen
from koopcli.simulation.samples.drive import DriveSample
from koopcli.simulation.samples.ellipsoid import EllipsoidSample
from koopcli.simulation.samples.greedy import GreedySample
from koopcli.simulation.samples.grid import GridSample
from koopcli.stages.advice import Case, advise

BEST_EDMD = load_experiment("best-edmd", {}).fit_edmd
BEST_EIGEN = load_experiment("best-eigen", {})
SURFACE = EllipsoidSample(m=1.0, Jzz=1.0)
FORCES = Case("forces", FitEdmd(), GridSample(), trained=True, tested=True)
SLIPS = Case("slips", FitEigen(), SURFACE, trained=False, tested=False)
WHEELS = Case("wheels", FitEdmd.of(basis="total", order=1), DriveSample(r_w=0.3), trained=True, tested=True)
CONSTANT_B, NEAREST = "a constant B limits it", "leave the middle of the volume empty"


def changed(case, **fit):
    return replace(case, fit=case.fit.but(**fit))


@pytest.mark.parametrize(
    ("case", "why", "experiment", "changes"),
    [
        (FORCES, CONSTANT_B, "best-edmd", {}),
        (replace(FORCES, sample=GridSample(count=7)), CONSTANT_B, "best-edmd", {"order": 6}),
        (replace(FORCES, sample=None), CONSTANT_B, "best-edmd", {}),
        (changed(FORCES, terms="bilinear"), "second order in the inputs", "best-edmd", {}),
        (replace(FORCES, diverged=True), "grow without bound", "best-edmd", {}),
        (replace(FORCES, tested=False), "without inputs the exact equations", "paper", {"order": 10}),
        (SLIPS, NEAREST, "best-eigen", {}),
        (changed(SLIPS, lift="linear"), NEAREST, "best-eigen", {}),
        (replace(SLIPS, fit=FitEdmd()), "tyre forces saturate", "best-eigen", {}),
        (WHEELS, CONSTANT_B, "paper", {"basis": "total", "order": 2, "terms": "bilinear"}),
    ],
)
def test_what_does_better(case, why, experiment, changes):
    found = advise(case)
    assert why in found.why
    assert found.better.experiment == experiment
    assert dict(found.better.changes) == changes


@pytest.mark.parametrize(
    ("case", "page"),
    [
        (replace(FORCES, fit=BEST_EDMD), "docs/paper.md"),
        (replace(FORCES, fit=BEST_EDMD.but(order=6), sample=GridSample(count=7)), "docs/paper.md"),
        (replace(FORCES, fit=FitEdmd.of(order=10), sample=GridSample(draw="even"), tested=False), "docs/paper.md"),
        (replace(FORCES, sample=GridSample(count=10), tested=False), "docs/paper.md"),  # too few values for order 10
        (
            replace(SLIPS, fit=BEST_EIGEN.fit_eigen, sample=BEST_EIGEN.sample("greedy")),
            "docs/beyond.md",
        ),
        (changed(WHEELS, terms="bilinear"), "docs/wheels.md"),
        (replace(WHEELS, fit=FitEigen(), tested=False), "docs/wheels.md"),
    ],
)
def test_where_nothing_is_known_to_do_better_a_page_says_more(case, page):
    found = advise(case)
    assert (found.better, found.page) == (None, page)
    assert CONSTANT_B not in found.why


def test_a_constant_b_is_blamed_only_where_inputs_act_on_linear_terms():
    for case in (FORCES, WHEELS):
        assert CONSTANT_B in advise(case).why
        assert CONSTANT_B not in advise(replace(case, tested=False)).why
        assert CONSTANT_B not in advise(changed(case, terms="generator")).why
        untrained = advise(replace(case, trained=False))
        assert "no input moves in the training data" in untrained.why
        assert (untrained.better, untrained.page) == (None, "")


def test_a_predictor_of_another_vehicle_is_tested_on_its_own():
    found = advise(replace(FORCES, elsewhere=True))
    assert found.own_test
    assert found.better is None


def test_the_design_of_the_best_eigenfunctions_has_a_greedy_sample():
    """What the rule takes it for."""
    assert isinstance(BEST_EIGEN.sample("ellipsoid"), GreedySample)
