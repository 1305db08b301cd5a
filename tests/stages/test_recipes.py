"""Which fit an experiment is about, and what follows it."""

from __future__ import annotations

import pytest

from koopcli.config.changes import parse_set
from koopcli.config.experiment import load_experiment
from koopcli.config.grids import parse_grid
from koopcli.errors import InvalidValueError
from koopcli.figures.kit.registry import FIGURES
from koopcli.stages import figure_tasks, recipes
from koopcli.stages.grid import cells
from koopcli.stages.recorded import recipe_of
from koopcli.store.identity import key_of

FITS = ("fit-edmd", "fit-eigen")
ABOUT = {None: "paper", "fit-edmd": "best-edmd", "fit-eigen": "best-eigen"}


def about(fit):
    return load_experiment("paper", parse_set([f"experiment.fit={fit}"]))


def test_the_best_experiments_say_which_fit_they_are_about():
    assert {fit: load_experiment(name, {}).about.fit for fit, name in ABOUT.items()} == {fit: fit for fit in ABOUT}
    found = recipes.evaluation(load_experiment("best-eigen", {})).input("predictor")
    assert (found.stage, found.settings.lift.kind) == ("fit-eigen", "polyharmonic")
    assert found.ancestor("sample").settings.kind == "greedy"
    found = recipes.evaluation(load_experiment("best-edmd", {})).input("predictor")
    assert (found.stage, found.settings.terms.kind) == ("fit-edmd", "generator")
    assert recipes.evaluation(load_experiment("paper", {})).input("predictor").stage == "fit-edmd"


def test_the_chunk_of_a_fit_is_in_its_key_where_it_has_an_effect():
    """Not where inputs are averaged over at once: there every size of a chunk is the same artefact."""
    grid, box = (
        {
            key_of(recipe_of(recipes.fit_edmd(load_experiment("paper", parse_set([*data, *chunk]))), {}))
            for chunk in ([], ["fit-edmd.chunk=77"])
        }
        for data in ([], ["sample.kind=box"])
    )
    assert (len(grid), len(box)) == (1, 2)


@pytest.mark.parametrize("fit", FITS)
def test_what_an_experiment_is_about_changes_no_recipe(fit):
    paper = load_experiment("paper", {})
    assert recipes.fit_edmd(about(fit)) == recipes.fit_edmd(paper)
    assert recipes.fit_eigen(about(fit)) == recipes.fit_eigen(paper)
    order_sweep = FIGURES["orders"].makes
    assert order_sweep(recipes, paper) == order_sweep(recipes, about(fit))


OF_LOGS = [name for name, kind in FIGURES.items() if kind.takes in figure_tasks.OF_LOGS.values()]


@pytest.mark.parametrize("name", OF_LOGS)
def test_a_figure_of_a_log_is_not_made_of_nothing(name):
    with pytest.raises(InvalidValueError, match="which koop cannot make: name it"):
        figure_tasks.artefacts(name, load_experiment("paper", {}))


@pytest.mark.parametrize("name", [name for name in FIGURES if name not in OF_LOGS])
def test_a_figure_follows_the_experiment_or_is_for_one_fit(name):
    """One that makes no fit follows nothing; one that is for a fit says so where the experiment is about the other."""

    def drawn(fit):
        return figure_tasks.artefacts(name, about(fit))

    kind, plain = FIGURES[name], figure_tasks.artefacts(name, load_experiment("paper", {}))
    for fit in FITS:
        if kind.usual is not None:
            assert drawn(fit)[0].find(fit) is not None
        elif kind.only in (None, fit):
            assert drawn(fit) == plain
        else:
            with pytest.raises(InvalidValueError, match=f"experiment.fit={kind.only}"):
                drawn(fit)
    assert all(task.stage in kind.stages for task in plain)
    if kind.usual is not None:
        assert drawn(kind.usual) == plain


def test_a_sweep_follows_the_experiment_unless_a_method_is_named():
    def stages(method, base, *sets):
        found = cells(parse_grid(sets), method, base, lambda task: None)
        return [cell.task.input("predictor").stage for cell in found]

    seeds = "test.seed=1,2"
    assert stages(None, "paper", seeds) == ["fit-edmd", "fit-edmd"]
    assert stages(None, "best-eigen", seeds) == ["fit-eigen", "fit-eigen"]
    assert stages("fit-edmd", "best-eigen", seeds) == ["fit-edmd", "fit-edmd"]
    assert stages(None, "paper", "experiment.fit=fit-edmd,fit-eigen") == list(FITS)
