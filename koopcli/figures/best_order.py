"""How often each order of the basis has the smallest error, over training draws."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from koopcli.config.experiment import Experiment
from koopcli.config.paper import BEST_ORDERS
from koopcli.config.pictures import Plot
from koopcli.errors import InvalidValueError
from koopcli.figures.kit.figure import FigureKind, Recipes, Source, Task, column
from koopcli.figures.kit.style import COLOURS, COLUMN, PAPER, Figure, legend_below, style, ticks
from koopcli.figures.orders import select as by_draw
from koopcli.records import Array
from koopcli.simulation.samples.grid import GridSample


def _sweep(recipes: Recipes, experiment: Experiment) -> list[Task]:
    """One evaluation for each order of the sweep, on each of many random training grids."""
    grid = experiment.sample("grid")
    if not isinstance(grid, GridSample):
        raise InvalidValueError("training draws are those of a grid: sample.kind must be 'grid'")
    evaluations = []
    for seed in range(experiment.reproduce.full_draws):
        training = recipes.simulation(experiment, recipes.sample(replace(grid, seed=seed)))
        for order in experiment.reproduce.orders:
            fit = recipes.fit_edmd(recipes.with_order(experiment, order), training)
            evaluations.append(recipes.evaluation(experiment, fit))
    return evaluations


FIGURE = FigureKind(
    about="how often each order is the best, over training draws",
    takes="evaluation",
    draws="points",
    makes=_sweep,
    only="fit-edmd",
    instead="it sweeps reproduce.orders over reproduce.full_draws random grids",
)


@dataclass(frozen=True)
class BestOrders:
    """Of each draw its order of the smallest mean error, among the ``orders`` (m,) that were tried."""

    orders: npt.NDArray[np.int64]
    best: npt.NDArray[np.int64]


def select(sources: Sequence[Source], settings: Plot) -> BestOrders:
    """What the figure shows. Raises ``InvalidValueError`` where every prediction of every evaluation diverged."""
    curves = by_draw(sources, settings)
    tried = np.unique(np.concatenate([curve.order for curve in curves]))
    best = [curve.order[np.nanargmin(curve.mean)] for curve in curves if np.isfinite(curve.mean).any()]
    return BestOrders(tried, np.array(best))


def numbers(shown: BestOrders) -> Mapping[str, Array]:
    """How many draws each order is the best of."""
    counts = [float((shown.best == order).sum()) for order in shown.orders]
    return {"order": column(shown.orders, "order", "1"), "draws": column(counts, "order", "1")}


def draw(shown: BestOrders) -> Figure:
    """A bar for each order; the paper's two are marked."""
    with style():
        figure = Figure(figsize=(COLUMN, 2.4), layout="constrained")
        axes = figure.subplots()
        counts = [int((shown.best == order).sum()) for order in shown.orders]
        axes.bar(shown.orders, counts, color=COLOURS[0], width=0.7, label=f"best of {len(shown.best)} training draws")
        best = [order for order in BEST_ORDERS if order in shown.orders]
        axes.plot(best, [0.0] * len(best), "^", color=PAPER, clip_on=False, zorder=5, label="the paper's best orders")
        axes.set_xticks(shown.orders)
        ticks(axes.yaxis, integer=True)
        axes.set_xlabel("order of the polynomial basis")
        axes.set_ylabel("training draws (1)")
        legend_below(figure)
    return figure
