"""Figures by name. A new figure is one file with ``drawing`` and one line here; matplotlib waits until one is drawn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from koopcli.config.settings import Series
from koopcli.figures.drawing import Drawing


@dataclass(frozen=True)
class FigureKind:
    """A figure: what it shows in a line, the module that draws it, and what it takes.

    ``roles``: of each evaluation, itself or what it was made from: ``evaluation``, ``predictor``, ``trajectories``
    (the test set), ``training``. ``several``: whether it draws more than one evaluation; ``method`` makes the
    predictors when no evaluation is named.
    """

    about: str
    module: str
    roles: tuple[str, ...]
    several: bool
    method: str

    def draw(self, series: Sequence[Series], inputs: Mapping[str, Any], image: str) -> Drawing:
        """The figure from records by ``number/role``, with a ``series`` entry for each evaluation."""
        drawn: Drawing = import_module(f"koopcli.figures.{self.module}").drawing(series, inputs, image)
        return drawn


FIGURES: dict[str, FigureKind] = {
    "orders": FigureKind(
        "RMSE against the order of the basis: mean, median, maximum", "orders", ("evaluation",), True, "edmd"
    ),
    "error-map": FigureKind(
        "RMSE by initial state in two planes, over the training trajectories",
        "error_map",
        ("evaluation", "training"),
        False,
        "eigen",
    ),
    "mean-trajectory": FigureKind(
        "the test trajectory whose RMSE is nearest the mean: true and predicted states",
        "mean_trajectory",
        ("evaluation", "predictor", "trajectories"),
        False,
        "eigen",
    ),
}
