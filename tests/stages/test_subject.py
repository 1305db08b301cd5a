"""What a figure is of, from the tasks behind it, and that its line is in no key."""

from __future__ import annotations

from dataclasses import replace

import pytest

from koopcli.config.experiment import load_experiment
from koopcli.config.shipped import called
from koopcli.console import Console
from koopcli.errors import UnknownNameError
from koopcli.stages import figure_tasks, recipes
from koopcli.stages import plot as plot_stage
from koopcli.stages.base import Task
from koopcli.stages.pipeline import Pipeline
from koopcli.stages.subject import subject
from koopcli.store import Store


def said(*artefacts, simulated=figure_tasks.simulated):
    of = subject(artefacts, simulated)
    return [called(one) for one in of.vehicles], list(of.predictors)


def test_vehicle_and_predictor_of_every_artefact_each_once():
    experiment = load_experiment("smoke", {})
    fit = recipes.fit_edmd(experiment)
    evaluation = recipes.evaluation(experiment, fit)
    bodies = ["ctu-2020 or rimac-2018"]
    assert said(fit) == said(evaluation) == (bodies, ["EDMD, order 3"])
    higher = recipes.evaluation(recipes.with_order(experiment, 4))
    assert said(evaluation, higher) == (bodies, ["EDMD, order 3", "EDMD, order 4"])
    assert said(recipes.sample(experiment.sample("ellipsoid"))) == (bodies, [])  # by mass and yaw inertia
    other = recipes.simulation(experiment.with_vehicle("bmw-320i"), plant="forces")
    elsewhere = recipes.evaluation(experiment, fit, other)
    assert said(elsewhere) == ([*bodies, "bmw-320i"], ["EDMD, order 3"])


def test_a_predictor_whose_trajectories_are_gone_remembers_its_vehicle():
    experiment = load_experiment("smoke", {})
    fit = recipes.fit_eigen(experiment)
    alone = replace(fit, inputs=())
    remembered = fit.ancestor("simulate").settings
    assert said(alone, simulated=lambda task: remembered) == (["ctu-2020"], ["eigenfunctions, thin-plate"])
    assert said(alone) == ([], ["eigenfunctions, thin-plate"])  # nobody remembers
    assert said(Task("evaluate", recipes.evaluation(experiment, fit).settings)) == ([], [])
    with pytest.raises(UnknownNameError):
        figure_tasks.simulated(alone)


def test_a_stored_picture_keeps_the_line_it_was_drawn_with(tmp_path, monkeypatch):
    """Another version alone redraws nothing, and what the old one drew goes on to say so."""
    experiment = load_experiment("smoke", {})

    def picture():
        console = Console()
        return Pipeline(Store(tmp_path, console.warn), console).make(figure_tasks.figure("tyre", [], "svg", experiment))

    monkeypatch.setattr(plot_stage, "__version__", "1.0")
    first = picture()
    monkeypatch.setattr(plot_stage, "__version__", "2.0")
    second = picture()
    assert (second.cached, second.record.name) == (True, first.record.name)
    assert "koop 1.0<" in second.content.image.decode()
    assert "ctu-2020" not in str(first.record.recipe["settings"]["of"])
