"""Figures by name, as their files declare them."""

from koopcli.figures import NAMES, module_of
from koopcli.figures.kit.figure import FigureKind

FIGURES: dict[str, FigureKind] = {name: module_of(name).FIGURE for name in NAMES}
