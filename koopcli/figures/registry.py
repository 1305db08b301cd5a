"""Figures by name. A new figure is one file and one line here; matplotlib waits until one is drawn.

The file ``koopcli/figures/<name>.py`` has three functions: ``select(sources, settings)`` gathers what the figure shows
in a small record, ``numbers(shown)`` gives that as columns, ``draw(shown)`` as a matplotlib figure.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Any, Literal

from koopcli.config.pictures import Plot
from koopcli.figures.drawing import Drawing, sources_of
from koopcli.figures.signature import signature

Takes = Literal["evaluation", "predictor", "fit", "sample", "trajectories", "sweep", "nothing"]


@dataclass(frozen=True)
class FigureKind:
    """A figure: what it shows in a line, and what it takes.

    ``takes``: the artefacts it draws, a ``fit`` being a predictor with lifted states; ``roles``: of each artefact,
    itself or what it was made from: ``evaluation``, ``predictor``, ``trajectories`` (the test set), ``training``,
    ``sample``. ``made``: what it makes when none is named, one of ``koopcli.stages.drawn.MADE``. ``draws``: one
    artefact, several ``beside`` one another on one test set, or several as ``points`` of curves ``against`` one of
    ``koopcli.stages.naming.AXES``. ``kinds``: of a sample, those it may be of. ``told``: fields of ``Plot`` that it
    uses.
    """

    about: str
    takes: Takes
    roles: tuple[str, ...]
    made: str
    draws: Literal["one", "beside", "points"] = "one"
    against: str = "order"
    kinds: tuple[str, ...] = ()
    told: tuple[str, ...] = ()


FIGURES: dict[str, FigureKind] = {
    "single-track": FigureKind("the vehicle: states, forces and angles with their signs", "nothing", (), "nothing"),
    "tyre": FigureKind(
        "tyre forces against slip, of the vehicle and of those shown beside it",
        "nothing",
        (),
        "vehicles",
        told=("tyres",),
    ),
    "trajectory": FigureKind(
        "one simulated trajectory: course, states and inputs",
        "trajectories",
        ("trajectories",),
        "manoeuvre",
        told=("trajectory", "cones"),
    ),
    "orders": FigureKind(
        "RMSE against the order of the basis, beside the paper's best",
        "evaluation",
        ("evaluation",),
        "orders",
        draws="points",
    ),
    "best-order": FigureKind(
        "how often each order is the best, over training draws",
        "evaluation",
        ("evaluation",),
        "draws",
        draws="points",
    ),
    "sweep": FigureKind("RMSE over a swept grid of settings", "sweep", ("sweep",), "sweep"),
    "random-input": FigureKind(
        "one trajectory under random inputs, true and predicted, with restarts",
        "predictor",
        ("predictor", "trajectories"),
        "edmd-fit",
        told=("restart",),
    ),
    "energy-surface": FigureKind(
        "Γ, the surface of one kinetic energy, with its initial states",
        "sample",
        ("sample",),
        "surface",
        kinds=("ellipsoid",),
    ),
    "error-map": FigureKind(
        "RMSE by initial state: its mean over a slice, and every state in space", "evaluation", ("evaluation",), "eigen"
    ),
    "error-side": FigureKind(
        "RMSE by initial state from the side, over the training trajectories",
        "evaluation",
        ("evaluation", "training"),
        "eigen",
    ),
    "mean-trajectory": FigureKind(
        "the test trajectory whose RMSE is nearest the mean, true and predicted",
        "evaluation",
        ("evaluation", "predictor", "trajectories"),
        "eigen",
    ),
    "rmse-histogram": FigureKind(
        "how the RMSE of the trajectories is distributed", "evaluation", ("evaluation",), "eigen", draws="beside"
    ),
    "horizon": FigureKind(
        "error against time, of one predictor or of several on one test set",
        "evaluation",
        ("evaluation", "predictor", "trajectories"),
        "beside",
        draws="beside",
    ),
    "compare": FigureKind(
        "the errors of several predictors on one test set, side by side",
        "evaluation",
        ("evaluation",),
        "beside",
        draws="beside",
    ),
    "density": FigureKind(
        "RMSE against the distance of the initial state to the data", "evaluation", ("evaluation",), "eigen"
    ),
    "before-after": FigureKind(
        "the errors of several predictors by initial state, side by side",
        "evaluation",
        ("evaluation",),
        "improved",
        draws="beside",
    ),
    "modes": FigureKind(
        "what the fit misses, and RMSE, against the number of rates",
        "evaluation",
        ("evaluation", "predictor"),
        "modes",
        draws="points",
        against="modes",
    ),
    "frontier": FigureKind(
        "RMSE against simulated seconds, of every vehicle",
        "evaluation",
        ("evaluation",),
        "budgets",
        draws="points",
        against="seconds",
    ),
    "trust": FigureKind(
        "errors and the bounds that the predictor gives for them", "evaluation", ("evaluation", "predictor"), "trusted"
    ),
    "spectrum": FigureKind(
        "damping of the modes of a predictor against their frequency", "fit", ("predictor",), "edmd-fit"
    ),
}


def drawing(settings: Plot, inputs: Mapping[str, Any], version: str = "") -> Drawing:
    """The figure that ``settings`` ask for, from records by ``number/role``, as this ``version`` of koop draws it."""
    from koopcli.figures.style import render  # noqa: PLC0415  (matplotlib only when something is drawn)

    module = import_module(f"koopcli.figures.{settings.figure.replace('-', '_')}")
    shown = module.select(sources_of(settings, inputs), settings)
    image = render(module.draw(shown), settings.format, signature(settings.of, version))
    return Drawing(settings.figure, settings.format, module.numbers(shown), image)
