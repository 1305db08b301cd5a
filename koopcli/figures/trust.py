"""Whether a predictor knows its errors: each against the bound given for it, and how many stay below."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from koopcli.config.pictures import Plot
from koopcli.errors import InvalidValueError
from koopcli.figures.kit.figure import FigureKind, Source, column, with_error
from koopcli.figures.kit.style import COLOURS, COLUMN, GUIDE, Figure, legend_below, plain_numbers, style
from koopcli.koopman.predictor.predictor import Predictor
from koopcli.koopman.scores.evaluation import Evaluation
from koopcli.records import Array, FloatArray

FIGURE = FigureKind(
    about="errors and the bounds that the predictor gives for them",
    takes="evaluation",
    behind=("predictor",),
    makes=lambda recipes, experiment: [
        recipes.evaluation(experiment, recipes.fit_eigen(recipes.best_eigen(experiment)))
    ],
    only="fit-eigen",
    instead="it draws best-eigen; name an evaluation, such as one of quick-eigen, to choose another",
)

SMALLEST = 1e-6  # percent: what is drawn of an error of nothing
PARTS = 5  # of the states by their bounds, each with its own share


@dataclass(frozen=True)
class Trusted:
    """The ``rmse`` (n,) and its ``bound`` (n,) in percent, by rising bound; ``covered``: the share below, and
    ``by_part`` (PARTS,) that of each fifth; ``level``: what it is meant to be.
    """

    rmse: FloatArray
    bound: FloatArray
    covered: float
    by_part: FloatArray
    level: float


def select(sources: Sequence[Source], settings: Plot) -> Trusted:
    """What the figure shows. Raises ``InvalidValueError`` for a predictor without bounds, and where every
    prediction diverged.
    """
    (shown,) = with_error(sources)
    evaluation: Evaluation = sources[0].records["evaluation"]
    predictor: Predictor = sources[0].records["predictor"]
    shown &= np.isfinite(evaluation.bound)
    trust = getattr(predictor, "trust", None)
    if trust is None or not shown.any():
        raise InvalidValueError(
            "this predictor says nothing of its errors: fit with --trust, such as with --experiment best-eigen"
        )
    order = np.argsort(evaluation.bound[shown], kind="stable")
    rmse, bound = evaluation.rmse[shown][order], evaluation.bound[shown][order]
    below = rmse <= bound
    parts = np.array([part.mean() for part in np.array_split(below, PARTS)])
    return Trusted(rmse, bound, float(below.mean()), parts, trust.level)


def numbers(shown: Trusted) -> Mapping[str, Array]:
    """Every error with its bound, and the shares."""
    return {
        "bound": column(shown.bound, "trajectory", "%"),
        "rmse": column(shown.rmse, "trajectory", "%"),
        "share below by fifths of the bound": column(shown.by_part, "fifth", "1"),
    }


def draw(shown: Trusted) -> Figure:
    """Errors below the line are within their bounds; below, the share of them in each fifth of the states."""
    bound, rmse = np.maximum(shown.bound, SMALLEST), np.maximum(shown.rmse, SMALLEST)
    inside = shown.rmse <= shown.bound
    with style():
        figure = Figure(figsize=(COLUMN, 4.4), layout="constrained")
        scatter, share = figure.subplots(2, 1, height_ratios=[2.4, 1])
        for which, colour, label in (
            (inside, COLOURS[0], f"within the bound: {100 * shown.covered:.1f} %"),
            (~inside, COLOURS[1], f"beyond it: {100 * (1 - shown.covered):.1f} %"),
        ):
            scatter.plot(bound[which], rmse[which], ".", color=colour, markersize=2, label=label, rasterized=True)
        ends = np.array([bound.min(), bound.max()])
        scatter.plot(ends, ends, "-", color=GUIDE, linewidth=0.8)
        scatter.set_xscale("log")
        scatter.set_yscale("log")
        plain_numbers(scatter.xaxis)
        plain_numbers(scatter.yaxis)
        scatter.set_xlabel("bound on the error (%)")
        scatter.set_ylabel("RMSE (%)")
        share.bar(np.arange(1, PARTS + 1), 100 * shown.by_part, width=0.6, color=COLOURS[5], zorder=2)
        share.axhline(100 * shown.level, color=GUIDE, linewidth=0.8, label=f"meant: {100 * shown.level:.0f} %")
        share.set_ylim(min(50.0, 100 * float(shown.by_part.min())), 100)
        share.set_xlabel("fifth of the states by rising bound (1)")
        share.set_ylabel("within (%)")
        legend_below(figure)
    return figure
