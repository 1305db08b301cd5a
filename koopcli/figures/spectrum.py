"""Eigenvalues of a predictor: of the discrete A beside the unit circle, as continuous rates beside the half plane."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from koopcli.config.pictures import Plot
from koopcli.figures.colours import COLOURS, GUIDE
from koopcli.figures.drawing import Source, column
from koopcli.figures.style import COLUMN, legend_below, style
from koopcli.koopman.modes import ComplexArray, Modes
from koopcli.koopman.predictor import Predictor
from koopcli.records import Array

TALL = 1.4  # height of a panel over its width
ROUNDING = 1e-9  # of an eigenvalue: one that is 1 neither grows nor decays


@dataclass(frozen=True)
class Spectrum:
    """``eigenvalues`` (m,) of A and their ``rates`` (m,) in 1/s, each ``copies`` times; an eigenvalue of zero has the
    rate minus infinity, which is not drawn.
    """

    eigenvalues: ComplexArray
    rates: ComplexArray
    copies: int


def select(sources: Sequence[Source], settings: Plot) -> Spectrum:
    """What the figure shows."""
    predictor: Predictor = sources[0].records["predictor"]
    if isinstance(predictor.A, Modes):
        return Spectrum(predictor.A.eigenvalues, predictor.A.rates, predictor.A.copies)
    eigenvalues = np.linalg.eigvals(predictor.A).astype(complex)
    eigenvalues = eigenvalues[np.lexsort([eigenvalues.imag, eigenvalues.real])]
    with np.errstate(divide="ignore"):
        rates = np.log(np.abs(eigenvalues)) / predictor.dt + 1j * (np.angle(eigenvalues) / predictor.dt)
    return Spectrum(eigenvalues, rates, 1)


def numbers(shown: Spectrum) -> Mapping[str, Array]:
    """Real and imaginary parts."""
    return {
        "eigenvalue/real": column(shown.eigenvalues.real, "eigenvalue", "1"),
        "eigenvalue/imaginary": column(shown.eigenvalues.imag, "eigenvalue", "1"),
        "rate/real": column(shown.rates.real, "eigenvalue", "1/s"),
        "rate/imaginary": column(shown.rates.imag, "eigenvalue", "1/s"),
        "copies": column(np.full(len(shown.rates), float(shown.copies)), "eigenvalue", "1"),
    }


def draw(shown: Spectrum) -> Figure:
    """Both views; what grows lies outside the circle and to the right of the line."""
    growing = np.abs(shown.eigenvalues) > 1 + ROUNDING
    with style():
        figure = Figure(figsize=(COLUMN, 2.7), layout="constrained")
        circle, plane = figure.subplots(1, 2)
        angle = np.linspace(0, 2 * np.pi, 721)
        circle.plot(np.cos(angle), np.sin(angle), color=GUIDE, linewidth=0.8, label="unit circle, half plane")
        plane.axvline(0, color=GUIDE, linewidth=0.8)
        for axes, values in ((circle, shown.eigenvalues), (plane, shown.rates)):
            drawn = np.isfinite(values)
            for which, colour, marker, label in (
                (~growing & drawn, COLOURS[0], "o", "decay or stay"),
                (growing & drawn, COLOURS[1], "^", "grow"),
            ):
                axes.plot(
                    values.real[which],
                    values.imag[which],
                    marker,
                    color=colour,
                    label=f"{which.sum()} that {label}" if axes is circle and which.any() else None,
                    fillstyle="none",
                    markersize=3,
                    markeredgewidth=0.6,
                    zorder=3,
                )
        _frame(circle, shown.eigenvalues)
        for axes, name, unit in ((circle, "eigenvalues of A", "1"), (plane, "their rates", "1/s")):
            axes.set_title(name, fontsize=8)
            axes.set_xlabel(f"real part ({unit})")
            axes.set_ylabel(f"imaginary part ({unit})")
            axes.set_box_aspect(TALL)
        title = f"each {shown.copies} times" if shown.copies > 1 else None
        legend_below(figure, title)
    return figure


def _frame(axes: Axes, values: ComplexArray) -> None:
    """Show all eigenvalues and as much of the circle as belongs to them, both axes to one scale."""
    width = max(np.ptp(values.real), np.ptp(values.imag) / TALL, 0.02) * 1.15
    x, y = (values.real.max() + values.real.min()) / 2, (values.imag.max() + values.imag.min()) / 2
    axes.set_xlim(x - width / 2, x + width / 2)
    axes.set_ylim(y - TALL * width / 2, y + TALL * width / 2)
