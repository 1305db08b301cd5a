"""How many rates pay: what the fit misses of the data, and the error of the prediction, against their number."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from koopcli.config.experiment import Experiment
from koopcli.config.pictures import Plot
from koopcli.errors import InvalidValueError
from koopcli.figures.kit.figure import FigureKind, Recipes, Source, Task, column
from koopcli.figures.kit.style import COLUMN, MARKERS, Figure, legend_below, looks, plain, plain_numbers, style, ticks
from koopcli.koopman.eigen.windows import AlongTrajectory
from koopcli.koopman.predictor.predictor import Predictor
from koopcli.records import Array, FloatArray


def _sweep(recipes: Recipes, experiment: Experiment) -> list[Task]:
    """One evaluation for each number of rates, of every kind; the best boundary values unless windows are fitted."""
    fit = experiment.fit_eigen
    if isinstance(fit.window, AlongTrajectory):
        fit = fit.but(boundary="optimal")
    fits = recipes.mode_fits(fit, experiment.reproduce.pairs)
    return [recipes.evaluation(experiment, recipes.fit_eigen(replace(experiment, fit_eigen=fit))) for fit in fits]


FIGURE = FigureKind(
    about="what the fit misses, and RMSE, against the number of rates",
    takes="evaluation",
    behind=("predictor",),
    draws="points",
    against="modes",
    makes=_sweep,
    only="fit-eigen",
    instead="it sweeps the degree of the lattice and reproduce.pairs",
)


@dataclass(frozen=True)
class ModeErrors:
    """By rising number of ``modes`` of one kind: what the fit ``missed`` and the ``mean`` RMSE, in percent."""

    label: str
    modes: FloatArray
    missed: FloatArray
    mean: FloatArray


def select(sources: Sequence[Source], settings: Plot) -> list[ModeErrors]:
    """Evaluations grouped by label. Raises ``InvalidValueError`` where every prediction of all of them diverged."""
    groups: dict[str, list[tuple[float, float, float]]] = {}
    for source in sources:
        predictor: Predictor = source.records["predictor"]
        mean = source.records["evaluation"].figures()["rmse"]["mean"]
        missed = np.nan if predictor.regression.missed is None else predictor.regression.missed
        groups.setdefault(source.label, []).append((source.at or 0.0, missed, mean))
    curves = [ModeErrors(label, *np.array(sorted(members)).T) for label, members in groups.items()]
    if not any(np.isfinite(curve.mean).any() for curve in curves):
        raise InvalidValueError("every prediction of these evaluations diverged: there is no error to draw")
    return curves


def numbers(shown: Sequence[ModeErrors]) -> Mapping[str, Array]:
    """Modes, what is missed and the mean error of each kind."""
    columns: dict[str, Array] = {}
    for curve in shown:
        columns[f"{curve.label}/modes"] = column(curve.modes, "fit", "1")
        columns[f"{curve.label}/missed"] = column(curve.missed, "fit", "%")
        columns[f"{curve.label}/mean"] = column(curve.mean, "fit", "%")
    return columns


def draw(shown: Sequence[ModeErrors]) -> Figure:
    """Both against the number of modes, one above the other."""
    with style():
        figure = Figure(figsize=(COLUMN, 4.2), layout="constrained")
        fit, prediction = figure.subplots(2, 1, sharex=True)
        for i, (curve, look) in enumerate(zip(shown, looks(len(shown)), strict=True)):
            marker = MARKERS[i % len(MARKERS)]
            fit.plot(curve.modes, curve.missed, marker=marker, label=plain(curve.label), **look)
            prediction.plot(curve.modes, curve.mean, marker=marker, **look)
        for axes, name in ((fit, "missed by the fit (%)"), (prediction, "mean RMSE (%)")):
            axes.set_yscale("log")
            plain_numbers(axes.yaxis)
            axes.set_ylabel(name)
        ticks(prediction.xaxis, integer=True)
        prediction.set_xlabel("modes of a state (1)")
        legend_below(figure, columns=3)
    return figure
