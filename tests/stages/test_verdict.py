"""What scores are worth: whether a predictor was fitted to what it is tested on."""

from __future__ import annotations

import pytest

from koopcli.config.changes import parse_set
from koopcli.config.experiment import load_experiment
from koopcli.stages import recipes
from koopcli.stages.pipeline import Pipeline
from koopcli.stages.verdict import fitted_to_test_data
from koopcli.store import Store
from tests.stages.test_pipeline import Listener

SMALL = ["sample.kind=box", "sample.count=30", "sample.steps=6", "sample.excitation=fresh", "fit-edmd.order=1"]
SAME = ["sample.seed=7", "test.count=30", "test.steps=6"]
OTHER = [*SAME[1:], "sample.seed=8"]


@pytest.fixture(scope="module")
def store(tmp_path_factory) -> Store:
    return Store(tmp_path_factory.mktemp("verdict"))


@pytest.fixture
def said(store):
    """Whether an evaluation counts as one on what was fitted."""
    line = Pipeline(store, Listener())

    def of(predictor, on=None, *settings) -> bool:
        return fitted_to_test_data(line.make(recipes.evaluation(experiment(*settings), predictor, on)).record, store)

    return of


def experiment(*settings):
    return load_experiment("paper", parse_set([*SMALL, *settings]))


def training(*settings):
    return recipes.simulation(experiment(*settings))


def named(store, task):
    """The task of an artefact by its name, as the command line has it."""
    line = Pipeline(store, Listener())
    return line.named(line.make(task).record.name)


def test_trajectories_that_were_fitted_are_known_by_any_name(store, said):
    data = training()
    fit = recipes.fit_edmd(experiment(), training("sample.seed=3"), data)
    assert said(fit, named(store, data))
    assert said(named(store, fit), data)
    assert said(recipes.fit_edmd(experiment(*SAME)), None, *SAME)  # the test set that the settings describe
    assert said(fit, training("simulate.chunk=60"))  # the same values under another key
    assert said(fit, training("simulate.steps=4"))  # their beginning


def test_others_are_not_taken_for_them(store, said):
    data = training()
    fit = recipes.fit_edmd(experiment(), data)
    assert not said(recipes.fit_edmd(experiment(*OTHER)), None, *OTHER)
    assert not said(fit, training("vehicle.Jzz=1731"))
    assert not said(recipes.fit_edmd(experiment(), training("simulate.steps=4")), data)  # most of it is new
    assert not said(recipes.baseline(experiment(), data), data)  # fitted to nothing
