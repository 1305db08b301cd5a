"""Γ: the surface of one kinetic energy, with the initial states on it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from koopcli.config.pictures import Plot
from koopcli.errors import InvalidValueError
from koopcli.figures.kit.figure import FigureKind, Source, column, state_columns
from koopcli.figures.kit.style import COLOURS, COLUMN, GUIDE, Figure, axis_label, in_space, style
from koopcli.records import Array, Channels, FloatArray, Sample
from koopcli.simulation.sampling import sphere_mesh

FIGURE = FigureKind(
    about="Γ, the surface of one kinetic energy, with its initial states",
    takes="sample",
    kinds=("ellipsoid",),
    makes=lambda recipes, experiment: [recipes.sample(experiment.sample("ellipsoid"))],
)

FINEST = 20  # faces from pole to pole at least, a multiple of the states' own
OFF_SURFACE = 1e-6  # relative, of states that are taken to lie on one surface


@dataclass(frozen=True)
class EnergySurface:
    """``x0`` (n, n_x) on the ellipsoid with the ``semi_axes`` (n_x,)."""

    x0: FloatArray
    semi_axes: FloatArray
    channels: Channels


def select(sources: Sequence[Source], settings: Plot) -> EnergySurface:
    """What the figure shows; Σ (x_i / a_i)² = 1 is linear in 1 / a_i², so the states tell their own surface.

    Raises ``InvalidValueError`` for states that lie on no such surface.
    """
    sample: Sample = sources[0].records["sample"]
    x0 = sample.x0
    inverse = np.linalg.lstsq(x0**2, np.ones(len(x0)), rcond=None)[0]
    if (inverse <= 0).any() or np.abs(x0**2 @ inverse - 1).max() > OFF_SURFACE:
        raise InvalidValueError("these states do not lie on a surface of one kinetic energy")
    return EnergySurface(x0, 1 / np.sqrt(inverse), sample.state_channels)


def numbers(shown: EnergySurface) -> Mapping[str, Array]:
    """The initial states, and the semi-axes of the surface."""
    axes = {
        f"semi-axis {name}": column(np.array([a]), "surface", unit)
        for name, unit, a in zip(shown.channels.names, shown.channels.units, shown.semi_axes, strict=True)
    }
    return {**state_columns(shown.x0, shown.channels, "state"), **axes}


def draw(shown: EnergySurface) -> Figure:
    """The surface as a mesh that has the vertices of a mesh of states; those behind it are paler."""
    names = [axis_label(n, u) for n, u in zip(shown.channels.names, shown.channels.units, strict=True)]
    between = max(4, round(math.sqrt(len(shown.x0))) - 1)
    n = between * math.ceil(FINEST / between) + 1
    X, Y, Z = (sphere_mesh(n * n) * shown.semi_axes).reshape(n, n, 3).transpose(2, 0, 1)
    with style():
        figure = Figure(figsize=(COLUMN, 3.2), layout="constrained")
        axes = figure.add_subplot(projection="3d", computed_zorder=False)
        in_space(axes, names, zoom=0.95)
        towards = _towards(axes.elev, axes.azim) / shown.semi_axes
        front = shown.x0 @ towards > 0
        axes.scatter(*shown.x0[~front].T, s=4, color=COLOURS[5], alpha=0.9, linewidths=0, depthshade=False, zorder=1)
        axes.plot_surface(X, Y, Z, color="white", alpha=0.5, shade=False, edgecolor=GUIDE, linewidth=0.25, zorder=2)
        axes.scatter(*shown.x0[front].T, s=6, color=COLOURS[0], linewidths=0, depthshade=False, zorder=3)
    return figure


def _towards(elevation: float, azimuth: float) -> FloatArray:
    """The direction to the eye, (3,), in a box of equal sides."""
    up, round_ = np.deg2rad(elevation), np.deg2rad(azimuth)
    return np.array([np.cos(up) * np.cos(round_), np.cos(up) * np.sin(round_), np.sin(up)])
