"""The errors of several predictors by initial state, side by side in one scale of colours."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from textwrap import fill

import numpy as np

from koopcli.config.experiment import Experiment
from koopcli.config.pictures import Plot
from koopcli.figures.kit.balls import LARGEST_SHOWN
from koopcli.figures.kit.figure import LOST, FigureKind, Recipes, Source, Task, column, state_columns, with_error
from koopcli.figures.kit.style import COLUMN, SHADES, Figure, axis_label, plain, plain_numbers, style, ticks
from koopcli.koopman.eigen.fit import FitEigen
from koopcli.koopman.scores.evaluation import Evaluation
from koopcli.records import Array, Channels, FloatArray


def _improved(recipes: Recipes, experiment: Experiment) -> list[Task]:
    """The paper's reading with the best boundary values, and the best predictors with one lookup and with several."""
    paper = replace(
        experiment, fit_eigen=FitEigen.of(boundary="optimal", cut=1e-10, tabulate=experiment.fit_eigen.tabulate)
    )
    trajectories = recipes.simulation(paper, plant="slips")
    best = (recipes.best_eigen(experiment, name=name) for name in (recipes.QUICK, recipes.BEST))
    fits = recipes.fit_eigen(paper, trajectories), *map(recipes.fit_eigen, best)
    return [recipes.evaluation(experiment, fit) for fit in fits]


FIGURE = FigureKind(
    about="the errors of several predictors by initial state, side by side",
    takes="evaluation",
    draws="beside",
    makes=_improved,
    only="fit-eigen",
    instead="it sets the paper's reading beside quick-eigen and best-eigen; name evaluations to choose others",
)

LEAST = 0.02  # quantile of all errors where the colours begin
FAINTEST = 1e-6  # percent
WIDE = 56  # letters of the titles of all columns
VIEWS = ((0, 1), (1, 2))  # states across and up: from above, and from the side


@dataclass(frozen=True)
class Errors:
    """The ``rmse`` (n,) in percent of the predictions from ``x0`` (n, n_x), the largest last; none where every
    prediction diverged, which the ``label`` then says.
    """

    label: str
    x0: FloatArray
    rmse: FloatArray
    channels: Channels


def select(sources: Sequence[Source], settings: Plot) -> list[Errors]:
    """What the figure shows. Raises ``InvalidValueError`` where every prediction of all evaluations diverged."""
    errors = []
    for source, shown in zip(sources, with_error(sources), strict=True):
        evaluation: Evaluation = source.records["evaluation"]
        order = np.argsort(evaluation.rmse[shown], kind="stable")
        label = source.label if shown.any() else source.label + LOST
        x0, rmse = evaluation.x0[shown][order], evaluation.rmse[shown][order]
        errors.append(Errors(label, x0, rmse, evaluation.state_channels))
    return errors


def numbers(shown: Sequence[Errors]) -> Mapping[str, Array]:
    """Every initial state with its error, of each predictor."""
    columns: dict[str, Array] = {}
    for scored in shown:
        columns |= state_columns(scored.x0, scored.channels, "trajectory", f"{scored.label}/{{}}_0")
        columns[f"{scored.label}/rmse"] = column(scored.rmse, "trajectory", "%")
    return columns


def draw(shown: Sequence[Errors]) -> Figure:
    """A column for each predictor, from above and from the side; the largest errors on top."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LogNorm

    errors = np.concatenate([scored.rmse for scored in shown])
    low = max(float(np.quantile(errors, LEAST)), FAINTEST)
    top = max(2 * low, float(np.quantile(errors, LARGEST_SHOWN)))
    shades = ScalarMappable(LogNorm(low, top), SHADES)
    with style():
        figure = Figure(figsize=(COLUMN, 4.6), layout="constrained")
        panels = figure.subplots(len(VIEWS), len(shown), sharex="row", sharey="row", squeeze=False)
        names = [axis_label(n, u) for n, u in zip(shown[0].channels.names, shown[0].channels.units, strict=True)]
        for scored, column_ in zip(shown, panels.T, strict=True):
            mean = f"\nmean {scored.rmse.mean():.3g} %" if len(scored.rmse) else ""
            name = fill(plain(scored.label), WIDE // len(shown))
            column_[0].set_title(f"{name}{mean}", fontsize=8)
            colours = shades.to_rgba(np.maximum(scored.rmse, low))
            for axes, (across, up) in zip(column_, VIEWS, strict=True):
                at = scored.x0[:, across], scored.x0[:, up]
                axes.scatter(*at, s=3, color=colours, linewidths=0, zorder=3, rasterized=True)
                ticks(axes.xaxis, 4)
        for row, (across, up) in zip(panels, VIEWS, strict=True):
            row[0].set_ylabel(names[up])
            for axes in row:
                axes.set_xlabel(names[across])
        bar = figure.colorbar(
            shades, ax=list(panels.ravel()), location="bottom", label="RMSE (%)", extend="both", aspect=35
        )
        plain_numbers(bar.ax.xaxis)
    return figure
