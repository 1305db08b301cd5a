"""What each method says on the first screen of a report, from the same scores as its tables."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

from koopcli.config.experiment import Experiment
from koopcli.config.paper import BEST_ORDERS, BEST_RMSE, EIGEN_RMSE
from koopcli.records import Meta
from koopcli.reproduction import beyond_cells, eigen_cells
from koopcli.reproduction.edmd_cells import Edmd
from koopcli.reproduction.report import Lead, Number, Race, Run
from koopcli.reproduction.texts import count_text, mean_text, number_text
from koopcli.simulation.samples.greedy import GreedySample
from koopcli.simulation.samples.sample import INPUTS, Excitation
from koopcli.stages import recipes
from koopcli.stages.base import Task

SHARE, FEWEST = 15, 10  # a budget of so much less than best-eigen's, of so many trajectories at least
CANDIDATES = 2000  # states to choose from, enough for a budget as small
PAPER_EIGEN = f"{EIGEN_RMSE[0]:g} ± {EIGEN_RMSE[1]:g}"


def _edmd(run: Run, kind: Excitation | None = None) -> tuple[Meta | None, Meta | None]:
    """The polynomials that the paper calls best, and the bilinear generator, on the first training draw."""
    edmd = Edmd(run.experiment)
    linear, bilinear = (run.known(edmd.evaluated(edmd.first, fit, kind)) for fit in (edmd.best, edmd.generator))
    return linear, bilinear


def _edmd_numbers(runs: Sequence[Run]) -> list[Number]:
    edmd = Edmd(runs[0].experiment)
    paper = f"{BEST_RMSE}" if edmd.order in BEST_ORDERS else "–"
    linear, bilinear = zip(*map(_edmd, runs), strict=True)
    counted = next((f"{figures['functions']} " for figures in bilinear if figures is not None), "")
    numbers = [
        Number(f"EDMD, order {edmd.order}, {INPUTS[edmd.inputs]}", paper, [*map(mean_text, linear)]),
        Number(f"{counted}bilinear functions, the same inputs", "–", [*map(mean_text, bilinear)]),
    ]
    for kind in reversed([kind for kind in edmd.experiment.reproduce.excitations if kind != edmd.inputs]):
        here = [mean_text(_edmd(run, kind)[0]) for run in runs]
        numbers.append(Number(f"EDMD, order {edmd.order}, {INPUTS[kind]}", paper, here))
    return numbers


def _edmd_clause(run: Run) -> str | None:
    order, (linear, bilinear) = Edmd(run.experiment).order, _edmd(run)
    if linear is None:
        return None
    counted = f"{count_text(linear['functions'])} polynomials (EDMD, order {order})"
    stated = f"{BEST_RMSE} % is the paper's best" if order in BEST_ORDERS else f"the paper's best is {BEST_RMSE} %"
    clause = f"Under random inputs, {counted} {_misses(linear)} ({stated})"
    if bilinear is None:
        return clause
    return f"{clause}, {bilinear['functions']} bilinear functions of the same data {_misses(bilinear)}"


def _misses(figures: Meta) -> str:
    mean = figures["rmse"]["mean"]
    return f"miss by {number_text(mean)}\u00a0%" if math.isfinite(mean) else "diverge"


def _edmd_race(experiment: Experiment) -> Race:
    edmd = Edmd(experiment)
    linear, bilinear = (edmd.trained(edmd.first, fit) for fit in (edmd.best, edmd.generator))
    return Race(((f"linear, order {edmd.order}", linear), ("bilinear, best-edmd", bilinear)))


def _first(task: Callable[[Experiment, int], Task], experiment: Experiment) -> Task:
    """The task on the first test states."""
    return task(experiment, experiment.reproduce.seeds[0])


def _of_vehicle(runs: Sequence[Run], vehicle: str, task: Callable[[Experiment, int], Task]) -> list[Meta | None]:
    """The numbers of an evaluation on the first test states, in each run that has the vehicle."""
    experiments = [dict(recipes.vehicles(run.experiment)).get(vehicle) for run in runs]
    return [
        None if experiment is None else run.known(_first(task, experiment))
        for run, experiment in zip(runs, experiments, strict=True)
    ]


def _vehicles(run: Run) -> list[str]:
    """The vehicles that any number is known of."""
    return list(dict.fromkeys(scored.cell.vehicle for scored in run.scored))


def _eigen_numbers(runs: Sequence[Run]) -> list[Number]:
    vehicles = _vehicles(runs[0])
    if not vehicles:
        return []
    scores = {vehicle: _of_vehicle(runs, vehicle, eigen_cells.headline) for vehicle in vehicles}
    main = vehicles[0]
    starts = ["–" if figures is None else number_text(figures["start_error"]["mean"]) for figures in scores[main]]
    held = _of_vehicle(runs, main, lambda own, seed: eigen_cells.beside(own, seed)[0])
    return [
        *(
            Number(f"eigenfunctions, {vehicle}", PAPER_EIGEN if vehicle == main else "–", [*map(mean_text, each)])
            for vehicle, each in scores.items()
        ),
        Number(f"error at the first sample, {main}", "not stated", starts),
        Number("baseline: the first state held", "–", [*map(mean_text, held)]),
    ]


def _eigen_clause(run: Run) -> str | None:
    figures = run.known(_first(eigen_cells.headline, run.experiment))
    if figures is None:
        return None
    return f"eigenfunctions of a coasting car {_misses(figures)} (in the paper by {PAPER_EIGEN}\u00a0%)"


def _eigen_race(experiment: Experiment) -> Race:
    """The experiment's reading beside best-eigen on a small budget, which costs a few seconds at most."""
    evaluation = _first(eigen_cells.headline, experiment)
    best = recipes.best_eigen(experiment)
    states = best.sample("greedy")
    assert isinstance(states, GreedySample)
    budget = max(states.budget / SHARE, FEWEST * states.steps * states.dt)
    few = recipes.sample(replace(states, budget=budget, candidates=min(CANDIDATES, states.candidates)))
    unbounded = replace(best, fit_eigen=best.fit_eigen.but(trust=False))
    fit = recipes.fit_eigen(unbounded, recipes.simulation(unbounded, few, plant="slips"))
    label = f"best-eigen on {few.settings.count * states.steps * states.dt:.0f} s of simulation"
    return Race((("the paper's method", evaluation.input("predictor")), (label, fit)), evaluation)


def _beyond_numbers(runs: Sequence[Run]) -> list[Number]:
    """The last rungs of the ladder of each vehicle."""
    rungs = {recipes.QUICK: beyond_cells.quick, recipes.BEST: beyond_cells.best}
    scores = {
        f"{name}, {vehicle}": _of_vehicle(runs, vehicle, task)
        for vehicle in _vehicles(runs[0])
        for name, task in rungs.items()
    }
    return [Number(label, "–", [*map(mean_text, each)]) for label, each in scores.items() if any(each)]


def _beyond_clause(run: Run) -> str | None:
    figures = run.known(_first(beyond_cells.best, run.experiment))
    return None if figures is None else f"those of best-eigen {_misses(figures)}"


def _beyond_race(experiment: Experiment) -> Race:
    evaluation = _first(eigen_cells.headline, experiment)
    best = recipes.fit_eigen(recipes.best_eigen(experiment))
    return Race((("the paper's method", evaluation.input("predictor")), ("best-eigen", best)), evaluation)


EDMD = Lead(_edmd_numbers, _edmd_clause, _edmd_race)
EIGEN = Lead(_eigen_numbers, _eigen_clause, _eigen_race)
BEYOND = Lead(_beyond_numbers, _beyond_clause, _beyond_race)
