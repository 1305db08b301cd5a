"""Which changes are refused because the same is made without them, and what is said of them."""

from __future__ import annotations

import pytest

from koopcli.config.changes import parse_set
from koopcli.config.experiment import load_experiment
from koopcli.stages import recipes
from koopcli.stages.effects import why_idle


def why(make, name, value, *others):
    """What is said of a change of the paper's experiment, beside ``others``."""
    experiment = load_experiment("paper", parse_set([f"{name}={value}", *others]))
    return why_idle(name, experiment, lambda other: [make(other)], [make(experiment)])


@pytest.mark.parametrize(
    ("make", "name", "value"),
    [
        (recipes.fit_edmd, "fit-edmd.order", 5),
        (recipes.fit_edmd, "fit-edmd.order", 7),  # the default
        (recipes.fit_edmd, "fit-edmd.basis.tensor.order", 7),
        (recipes.fit_edmd, "fit-edmd.basis", "tensor"),
        (recipes.fit_eigen, "simulate.v_eps", 0.1),  # of a plant that the experiment does not name
        (recipes.fit_eigen, "simulate.plant.slips.v_eps", 0.1),
        (recipes.fit_eigen, "simulate.combined", "none"),
        (recipes.simulation, "simulate.plant", "forces"),
        (recipes.simulation, "sample.kind", "grid"),
        (recipes.simulation, "sample.grid.draw", "random"),
        (recipes.evaluation, "experiment.fit", "fit-edmd"),
        (recipes.evaluation, "evaluate.first", 1),  # which the plant leaves open
        (recipes.fit_eigen, "vehicle.name", "rimac-2018"),
    ],
)
def test_what_has_an_effect_or_is_in_effect_is_taken(make, name, value):
    assert why(make, name, value) is None


@pytest.mark.parametrize(
    ("make", "name", "value", "says"),
    [
        (recipes.fit_eigen, "simulate.v_eps", 0.2, None),
        (recipes.fit_edmd, "simulate.v_eps", 0.2, "the plant 'forces' has no use for it"),
        (recipes.fit_edmd, "fit-edmd.basis.total.order", 7, "the basis is not 'total'"),
        (recipes.fit_eigen, "fit-eigen.window.horizon.cut", 1e-14, "the window is not 'horizon'"),  # else the default
        (recipes.fit_edmd, "sample.ball.seed", 0, "no sample of kind 'ball' is used"),
        (recipes.fit_edmd, "vehicle.mu_scale", 0.8, "the plant 'forces' has no use for it"),
        (recipes.fit_edmd, "fit-eigen.window", "horizon", "nothing is made by it"),
        (recipes.fit_edmd, "experiment.fit", "fit-eigen", "the fit is named"),
    ],
)
def test_what_changes_nothing_is_refused_with_its_reason(make, name, value, says):
    assert why(make, name, value) == says


def test_a_setting_of_a_kind_that_is_not_in_effect_is_refused_whatever_stands_beside_it():
    assert why(recipes.fit_edmd, "fit-edmd.basis.total.order", 6, "fit-edmd.order=6") == "the basis is not 'total'"
