"""Figures by name. A new figure is one file and one line here."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from koopcli.figures import orders
from koopcli.figures.drawing import Drawing


@dataclass(frozen=True)
class FigureKind:
    """A figure: what it shows in a line, and how it is drawn from plain records."""

    about: str
    draw: Callable[[Any, str], Drawing]


FIGURES: dict[str, FigureKind] = {
    "orders": FigureKind("RMSE against the order of the basis: mean, median, maximum", orders.drawing),
}
