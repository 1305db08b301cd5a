"""How fast the modes of a predictor decay, against how fast they swing: many on one place are counted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from koopcli.config.pictures import Plot
from koopcli.figures.kit.figure import FigureKind, Source, column
from koopcli.figures.kit.style import COLOURS, COLUMN, GUIDE, Axes, Figure, legend_below, style, ticks
from koopcli.koopman.predictor.dynamics.diagonal import Diagonal
from koopcli.koopman.predictor.modes import ComplexArray
from koopcli.koopman.predictor.predictor import Predictor
from koopcli.records import Array, FloatArray

FIGURE = FigureKind(
    about="damping of the modes of a predictor against their frequency",
    takes="fit",
    usual="fit-edmd",
)

ROUNDING = 1e-9  # of an eigenvalue: one that is 1 neither grows nor decays
DECADES = 4  # of damping that are drawn on a logarithmic axis; what is nearer to zero lies on a linear one
SLOWEST = 1.0  # Hz, where the axis of frequencies ends at least
BINS = 24  # of damping, counted beside the rings


@dataclass(frozen=True)
class Spectrum:
    """``eigenvalues`` (m,) of A and their ``rates`` (m,) in 1/s, each ``copies`` times; an eigenvalue of zero has the
    rate minus infinity, which is not drawn. ``counts`` (bins,) of all copies with a damping between ``edges``
    (bins + 1,) in 1/s, even on an axis that is linear up to ``linear``.
    """

    eigenvalues: ComplexArray
    rates: ComplexArray
    copies: int
    linear: float
    edges: FloatArray
    counts: FloatArray


def select(sources: Sequence[Source], settings: Plot) -> Spectrum:
    """What the figure shows."""
    predictor: Predictor = sources[0].records["predictor"]
    dynamics = predictor.dynamics
    if isinstance(dynamics, Diagonal):
        eigenvalues, rates, copies = dynamics.eigenvalues, dynamics.modes.rates, dynamics.modes.copies
    else:
        eigenvalues = dynamics.eigenvalues
        eigenvalues = eigenvalues[np.lexsort([eigenvalues.imag, eigenvalues.real])]
        with np.errstate(divide="ignore"):
            rates = np.log(np.abs(eigenvalues)) / predictor.dt + 1j * (np.angle(eigenvalues) / predictor.dt)
        copies = 1
    damping = -rates.real[np.isfinite(rates)]
    sizes = np.abs(damping[damping != 0]) if damping.any() else np.ones(1)
    largest = float(sizes.max())
    linear = 10.0 ** max(np.ceil(np.log10(largest)) - DECADES, np.floor(np.log10(sizes.min())))
    low, high = _stretched(np.array([damping.min(initial=0.0), damping.max(initial=linear)]), linear)
    edges = _back(np.linspace(low, high, BINS + 1), linear)
    edges[[0, -1]] *= 1 + 1e-9  # away from zero by more than rounding
    counts = copies * np.histogram(damping, edges)[0].astype(float)
    return Spectrum(eigenvalues, rates, copies, linear, edges, counts)


def numbers(shown: Spectrum) -> Mapping[str, Array]:
    """Real and imaginary parts, and how many lie between which dampings."""
    return {
        "eigenvalue/real": column(shown.eigenvalues.real, "eigenvalue", "1"),
        "eigenvalue/imaginary": column(shown.eigenvalues.imag, "eigenvalue", "1"),
        "rate/real": column(shown.rates.real, "eigenvalue", "1/s"),
        "rate/imaginary": column(shown.rates.imag, "eigenvalue", "1/s"),
        "copies": column(np.full(len(shown.rates), float(shown.copies)), "eigenvalue", "1"),
        "bin/damping from": column(shown.edges[:-1], "bin", "1/s"),
        "bin/damping to": column(shown.edges[1:], "bin", "1/s"),
        "bin/count": column(shown.counts, "bin", "1"),
    }


def draw(shown: Spectrum) -> Figure:
    """A ring for each pair of rates and each real one, and how many share a damping; what grows is below zero."""
    drawn = np.isfinite(shown.rates) & (shown.rates.imag >= 0)  # of a pair the half with the positive frequency
    frequency, damping = shown.rates.imag[drawn] / (2 * np.pi), -shown.rates.real[drawn]
    growing = np.abs(shown.eigenvalues[drawn]) > 1 + ROUNDING
    all_growing = np.abs(shown.eigenvalues) > 1 + ROUNDING
    with style():
        figure = Figure(figsize=(COLUMN, 2.7), layout="constrained")
        plane, density = figure.subplots(1, 2, sharey=True, width_ratios=[3, 1])
        for which, everywhere, colour, marker, label in (
            (~growing, ~all_growing, COLOURS[0], "o", "decay or stay"),
            (growing, all_growing, COLOURS[1], "^", "grow"),
        ):
            if which.any():
                name = f"{shown.copies * everywhere.sum()} that {label}"
                look = {"fillstyle": "none", "markersize": 3, "markeredgewidth": 0.6, "zorder": 3, "clip_on": False}
                plane.plot(frequency[which], damping[which], marker, color=colour, label=name, **look)
        density.stairs(shown.counts, shown.edges, orientation="horizontal", fill=True, color=COLOURS[5])
        for axes in (plane, density):
            axes.axhline(0, color=GUIDE, linewidth=0.8)
        fastest = max(SLOWEST, float(frequency.max(initial=0.0)))
        plane.set_xlim(-0.03 * fastest, 1.03 * fastest)  # room for rings at zero
        ticks(plane.xaxis, 5, steps=[1, 2, 5, 10])
        density.set_xlim(left=0)
        _damping_axis(plane, shown)
        plane.set_xlabel("frequency (Hz)")
        plane.set_ylabel("damping (1/s)")
        density.set_xlabel("number (1)")
        ticks(density.xaxis, 2, integer=True)
        legend_below(figure, f"each {shown.copies} times" if shown.copies > 1 else None)
    return figure


def _damping_axis(axes: Axes, shown: Spectrum) -> None:
    """Damping, logarithmic to both sides of zero where it goes far."""
    from matplotlib.ticker import FuncFormatter, NullFormatter, SymmetricalLogLocator

    axes.set_yscale("symlog", linthresh=shown.linear)
    low, high = _stretched(shown.edges[[0, -1]], shown.linear)
    margin = 0.05 * (high - low)
    axes.set_ylim(*_back(np.array([low - margin, high + margin]), shown.linear))
    axes.yaxis.set_major_locator(SymmetricalLogLocator(base=10, linthresh=shown.linear))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())


def _stretched(values: FloatArray, linear: float) -> FloatArray:
    """Places on an axis that is linear up to ``linear`` and then has a unit for each factor of ten."""
    size = np.abs(values) / linear
    return np.sign(values) * np.where(size <= 1, size, 1 + np.log10(np.maximum(size, 1)))


def _back(places: FloatArray, linear: float) -> FloatArray:
    """The values at places of :func:`_stretched`."""
    size = np.abs(places)
    return np.sign(places) * linear * np.where(size <= 1, size, 10.0 ** (np.maximum(size, 1) - 1))
