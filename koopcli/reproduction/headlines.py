"""What each method says on the first screen of a report, from the same scores as its tables."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from koopcli.config.experiment import Experiment
from koopcli.config.paper import BEST_ORDERS, BEST_RMSE, EIGEN_RMSE
from koopcli.records import Meta
from koopcli.reproduction import beyond_cells, edmd_cells, eigen_cells
from koopcli.reproduction.report import Lead, Number, Race, Run, count_text, mean_text, number_text
from koopcli.simulation.samples.greedy import GreedySample
from koopcli.simulation.samples.sample import INPUTS
from koopcli.stages import recipes
from koopcli.stages.base import Task

SHARE, FEWEST = 15, 10  # a budget of so much less than best-eigen's, of so many trajectories at least
CANDIDATES = 2000  # states to choose from, enough for a budget as small
PAPER_EIGEN = f"{EIGEN_RMSE[0]:g} ± {EIGEN_RMSE[1]:g}"


def _find(run: Run, block: str, **wanted: object) -> Meta | None:
    """The numbers of the first cell of a block with what is ``wanted`` of its fields."""
    for scored in run.scored:
        fields = vars(scored.cell)
        if fields["block"] == block and all(fields[name] == value for name, value in wanted.items()):
            return scored.figures
    return None


def _edmd(run: Run, excitation: str) -> tuple[Meta | None, Meta | None]:
    """The polynomials that the paper calls best, and the bilinear generator, on the first training draw."""
    draw, order = edmd_cells.trainings(run.experiment)[0].name, edmd_cells.best_order(run.experiment)
    label = edmd_cells.outlook_name(run.experiment, edmd_cells.bilinear(run.experiment, "generator"))
    return (
        _find(run, edmd_cells.SWEEP, draw=draw, order=order, excitation=excitation),
        _find(run, edmd_cells.OTHERS, draw=draw, label=label, excitation=excitation),
    )


def _edmd_numbers(runs: Sequence[Run]) -> list[Number]:
    first = runs[0].experiment
    order, main = edmd_cells.best_order(first), edmd_cells.excitation(first)
    paper = f"{BEST_RMSE}" if order in BEST_ORDERS else "–"
    both = [_edmd(run, main) for run in runs]
    counted = next((f"{bilinear['functions']} " for _, bilinear in both if bilinear is not None), "")
    found = [
        Number(f"EDMD, order {order}, {INPUTS[main]}", paper, [mean_text(linear) for linear, _ in both]),
        Number(f"{counted}bilinear functions, the same inputs", "–", [mean_text(bilinear) for _, bilinear in both]),
    ]
    for kind in reversed([kind for kind in first.reproduce.excitations if kind != main]):
        here = [mean_text(_edmd(run, kind)[0]) for run in runs]
        found.append(Number(f"EDMD, order {order}, {INPUTS[kind]}", paper, here))
    return found


def _edmd_clause(run: Run) -> str | None:
    order = edmd_cells.best_order(run.experiment)
    linear, bilinear = _edmd(run, edmd_cells.excitation(run.experiment))
    if linear is None:
        return None
    counted = f"{count_text(linear['functions'])} polynomials (EDMD, order {order})"
    stated = f"{BEST_RMSE} % is the paper's best" if order in BEST_ORDERS else f"the paper's best is {BEST_RMSE} %"
    said = f"Under random inputs, {counted} {_misses(linear)} ({stated})"
    return (
        said
        if bilinear is None
        else f"{said}, {bilinear['functions']} bilinear functions of the same data {_misses(bilinear)}"
    )


def _misses(figures: Meta) -> str:
    mean = figures["rmse"]["mean"]
    return f"miss by {number_text(mean)}\u00a0%" if math.isfinite(mean) else "diverge"


def _edmd_race(experiment: Experiment) -> Race:
    data = edmd_cells.training_set(experiment, edmd_cells.trainings(experiment)[0])
    order, bilinear = edmd_cells.best_order(experiment), edmd_cells.bilinear(experiment, "generator")
    linear = recipes.with_order(experiment, order).fit_edmd
    fits = [recipes.fit_edmd(replace(experiment, fit_edmd=fit), data) for fit in (linear, bilinear)]
    return Race(((f"linear, order {order}", fits[0]), ("bilinear, best-edmd", fits[1])))


def _eigen(run: Run, **wanted: object) -> Meta | None:
    return _find(run, eigen_cells.HEADLINE, seed=run.experiment.reproduce.seeds[0], **wanted)


def _eigen_numbers(runs: Sequence[Run]) -> list[Number]:
    vehicles = list(dict.fromkeys(scored.cell.vehicle for scored in runs[0].scored))
    if not vehicles:
        return []
    found = []
    for vehicle in vehicles:
        paper = PAPER_EIGEN if vehicle == vehicles[0] else "–"
        here = [mean_text(_eigen(run, vehicle=vehicle)) for run in runs]
        found.append(Number(f"eigenfunctions, {vehicle}", paper, here))
    main = [_eigen(run, vehicle=vehicles[0]) for run in runs]
    starts = ["–" if figures is None else number_text(figures["start_error"]["mean"]) for figures in main]
    found.append(Number(f"error at the first sample, {vehicles[0]}", "not stated", starts))
    held = [_find(run, eigen_cells.BASELINES, vehicle=vehicles[0]) for run in runs]
    found.append(Number("baseline: the first state held", "–", [mean_text(figures) for figures in held]))
    return found


def _eigen_clause(run: Run) -> str | None:
    figures = _eigen(run, vehicle=run.scored[0].cell.vehicle) if run.scored else None
    if figures is None:
        return None
    return f"eigenfunctions of a coasting car {_misses(figures)} (in the paper by {PAPER_EIGEN}\u00a0%)"


def _paper_fit(experiment: Experiment) -> Task:
    """The evaluation of the experiment's own reading."""
    return eigen_cells.evaluated(experiment, experiment.fit_eigen, experiment.reproduce.seeds[0])


def _eigen_race(experiment: Experiment) -> Race:
    """The experiment's reading beside best-eigen on a small budget, which costs a few seconds at most."""
    evaluation = _paper_fit(experiment)
    best = recipes.best_eigen(experiment)
    states = best.sample("greedy")
    assert isinstance(states, GreedySample)
    budget = max(states.budget / SHARE, FEWEST * states.steps * states.dt)
    few = recipes.sample(replace(states, budget=budget, candidates=min(CANDIDATES, states.candidates)))
    there = replace(best, fit_eigen=best.fit_eigen.but(trust=False))
    fit = recipes.fit_eigen(there, recipes.simulation(there, few, plant="slips"))
    label = f"best-eigen on {few.settings.count * states.steps * states.dt:.0f} s of simulation"
    return Race((("the paper's method", evaluation.input("predictor")), (label, fit)), evaluation)


def _beyond_numbers(runs: Sequence[Run]) -> list[Number]:
    """The last rung of the ladder of each vehicle."""
    found = []
    for vehicle in dict.fromkeys(scored.cell.vehicle for scored in runs[0].scored):
        scores = [_best(run, vehicle) for run in runs]
        if any(scores):
            found.append(Number(f"best-eigen, {vehicle}", "–", [mean_text(figures) for figures in scores]))
    return found


def _beyond_clause(run: Run) -> str | None:
    figures = _best(run, run.scored[0].cell.vehicle) if run.scored else None
    return None if figures is None else f"those of best-eigen {_misses(figures)}"


def _best(run: Run, vehicle: str) -> Meta | None:
    block, seed = beyond_cells.LADDER, run.experiment.reproduce.seeds[0]
    found = [s.figures for s in run.scored if (s.cell.block, s.cell.vehicle, s.cell.seed) == (block, vehicle, seed)]
    return found[-1] if found else None


def _beyond_race(experiment: Experiment) -> Race:
    evaluation = _paper_fit(experiment)
    best = recipes.fit_eigen(recipes.best_eigen(experiment))
    return Race((("the paper's method", evaluation.input("predictor")), ("best-eigen", best)), evaluation)


EDMD = Lead(_edmd_numbers, _edmd_clause, _edmd_race)
EIGEN = Lead(_eigen_numbers, _eigen_clause, _eigen_race)
BEYOND = Lead(_beyond_numbers, _beyond_clause, _beyond_race)
