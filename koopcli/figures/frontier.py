"""What error simulated seconds pay for: a panel for each vehicle, a line for each method."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from koopcli.config.experiment import Experiment
from koopcli.config.pictures import Plot
from koopcli.errors import InvalidValueError
from koopcli.figures.kit.figure import FigureKind, Recipes, Source, Task, column
from koopcli.figures.kit.style import COLUMN, MARKERS, Figure, legend_below, looks, plain, plain_numbers, style
from koopcli.records import Array, FloatArray
from koopcli.simulation.samples.greedy import GreedySample


def _sweep(recipes: Recipes, experiment: Experiment) -> list[Task]:
    """The best predictors on every budget, with and without mirror images, for every vehicle shown."""
    evaluations = []
    for _, driving in recipes.vehicles(experiment):
        for budget, name in product(experiment.reproduce.budgets, (recipes.BEST, recipes.QUICK)):
            best = recipes.best_eigen(driving, budget, name)
            states = best.sample("greedy")
            assert isinstance(states, GreedySample)
            for mirrored in (True, False):
                chosen = replace(states, mirror=states.mirror if mirrored else ())
                fit = replace(best.fit_eigen, mirror=best.fit_eigen.mirror if mirrored else ())
                training = recipes.simulation(best, recipes.sample(chosen), plant="slips")
                trained = recipes.fit_eigen(replace(best, fit_eigen=fit), training)
                test = recipes.test_set(experiment, trained.ancestor("simulate").settings)
                evaluations.append(recipes.evaluation(experiment, trained, test))
    return evaluations


FIGURE = FigureKind(
    about="RMSE against simulated seconds, of every vehicle",
    takes="evaluation",
    draws="points",
    against="seconds",
    makes=_sweep,
    only="fit-eigen",
    instead="it draws best-eigen and quick-eigen on reproduce.budgets; name evaluations to choose others",
)

PANEL = 2.3  # inches


@dataclass(frozen=True)
class Frontier:
    """Mean errors in percent of one ``method`` on one ``vehicle``, by rising ``seconds``."""

    vehicle: str
    method: str
    seconds: FloatArray
    mean: FloatArray


def select(sources: Sequence[Source], settings: Plot) -> list[Frontier]:
    """Evaluations by vehicle and method, which a label has before and after its colon.

    Raises ``InvalidValueError`` where every prediction of every evaluation diverged.
    """
    groups: dict[str, list[tuple[float, float]]] = {}
    for source in sources:
        mean = source.records["evaluation"].figures()["rmse"]["mean"]
        groups.setdefault(source.label, []).append((source.at or 0.0, mean))
    frontiers = []
    for label, members in groups.items():
        vehicle, colon, method = label.partition(": ")
        seconds, mean = np.array(sorted(members)).T
        frontiers.append(Frontier(vehicle if colon else "", method if colon else vehicle, seconds, mean))
    if not any(np.isfinite(curve.mean).any() for curve in frontiers):
        raise InvalidValueError("every prediction of these evaluations diverged: there is no error to draw")
    return frontiers


def numbers(shown: Sequence[Frontier]) -> Mapping[str, Array]:
    """Seconds and mean error of each line."""
    columns: dict[str, Array] = {}
    for curve in shown:
        name = f"{curve.vehicle}: {curve.method}" if curve.vehicle else curve.method
        columns[f"{name}/simulated"] = column(curve.seconds, "budget", "s")
        columns[f"{name}/mean"] = column(curve.mean, "budget", "%")
    return columns


def draw(shown: Sequence[Frontier]) -> Figure:
    """Panels below one another, which share their axes; a method has one colour and mark in all of them."""
    vehicles, methods = (list(dict.fromkeys(getattr(curve, name) for curve in shown)) for name in ("vehicle", "method"))
    look = dict(zip(methods, looks(len(methods)), strict=True))
    mark = {method: MARKERS[i % len(MARKERS)] for i, method in enumerate(methods)}
    with style():
        figure = Figure(figsize=(COLUMN, 0.7 + PANEL * len(vehicles)), layout="constrained")
        panels = figure.subplots(len(vehicles), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
        named: set[str] = set()
        for axes, vehicle in zip(panels, vehicles, strict=True):
            for curve in (curve for curve in shown if curve.vehicle == vehicle):
                label = None if curve.method in named else plain(curve.method)
                named.add(curve.method)
                axes.plot(curve.seconds, curve.mean, marker=mark[curve.method], label=label, **look[curve.method])
            axes.set_xscale("log")
            axes.set_yscale("log")
            axes.set_ylabel("mean RMSE (%)")
            if vehicle:
                axes.set_title(plain(vehicle), fontsize=8)
        plain_numbers(panels[0].yaxis)
        plain_numbers(panels[-1].xaxis)
        panels[-1].set_xlabel("simulated time of the training data (s)")
        legend_below(figure, columns=1)
    return figure
