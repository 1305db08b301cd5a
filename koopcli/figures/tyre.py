"""The tyres of vehicles: force against slip, sideways and along."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from koopcli.config.experiment import Experiment
from koopcli.config.pictures import Plot, Tyres
from koopcli.errors import InvalidValueError
from koopcli.figures.kit.figure import FigureKind, Recipes, Source, Task, column
from koopcli.figures.kit.style import COLUMN, GUIDE, Figure, legend_below, looks, plain, style
from koopcli.records import Array, FloatArray
from koopcli.vehicles.handling import tyres_of, wheel_loads
from koopcli.vehicles.parameters import TYRES
from koopcli.vehicles.tyre import force

OF_TYRES = ("m", "l_f", "l_r", "mu_scale", *TYRES)  # parameters that tyre forces depend on


def _tyres(recipes: Recipes, experiment: Experiment, artefacts: Sequence[Task]) -> tuple[Tyres, ...]:
    """The tyres of the experiment's vehicle and of those beside it. Raises ``InvalidValueError`` for one without."""
    tyres = []
    for name, driving in recipes.vehicles(experiment):
        p = driving.vehicle
        if p.lateral is None or p.longitudinal is None:
            raise InvalidValueError(f"the vehicle {name} has no tyres: give its file [lateral] and [longitudinal]")
        tyres.append(Tyres(name, wheel_loads(p), p.mu_scale, tyres_of(p, "lateral"), tyres_of(p, "longitudinal")))
    return tuple(tyres)


FIGURE = FigureKind(
    about="tyre forces against slip, of the vehicle and of those shown beside it",
    takes="nothing",
    told={"tyres": _tyres},
    parameters=OF_TYRES,
)

LARGEST_ANGLE, LARGEST_RATIO = np.deg2rad(30.0), 0.5
POINTS = 401


@dataclass(frozen=True)
class TyreCurve:
    """Force in N of one wheel of the axle in ``label``: ``lateral`` (m,) against ``slip_angle`` (m,) in rad and
    ``longitudinal`` (m,) against ``slip_ratio`` (m,).
    """

    label: str
    slip_angle: FloatArray
    lateral: FloatArray
    slip_ratio: FloatArray
    longitudinal: FloatArray


def select(sources: Sequence[Source], settings: Plot) -> list[TyreCurve]:
    """A curve for each vehicle, two for one whose axles carry different loads."""
    return [curve for tyres in settings.tyres for curve in _curves(tyres)]


def _curves(tyres: Tyres) -> list[TyreCurve]:
    front, rear = zip(tyres.loads, tyres.lateral, tyres.longitudinal, strict=True)
    alike = front == rear
    axles = [(tyres.label, front)] if alike else [(f"{tyres.label}, front", front), (f"{tyres.label}, rear", rear)]
    angle = np.linspace(-LARGEST_ANGLE, LARGEST_ANGLE, POINTS)
    ratio = np.linspace(-LARGEST_RATIO, LARGEST_RATIO, POINTS)
    grip = tyres.mu_scale
    return [
        TyreCurve(label, angle, grip * force(lateral, angle, load), ratio, grip * force(longitudinal, ratio, load))
        for label, (load, lateral, longitudinal) in axles
    ]


def numbers(curves: Sequence[TyreCurve]) -> Mapping[str, Array]:
    """Slips and forces of every curve."""
    columns: dict[str, Array] = {}
    for curve in curves:
        for name, unit in (("slip_angle", "rad"), ("lateral", "N"), ("slip_ratio", "1"), ("longitudinal", "N")):
            columns[f"{curve.label}/{name}"] = column(getattr(curve, name), "point", unit)
    return columns


def draw(curves: Sequence[TyreCurve]) -> Figure:
    """Lateral and longitudinal force of one wheel under its static load."""
    with style():
        figure = Figure(figsize=(COLUMN, 2.3), layout="constrained")
        side, along = figure.subplots(1, 2, sharey=True)
        for curve, look in zip(curves, looks(len(curves)), strict=True):
            side.plot(np.rad2deg(curve.slip_angle), curve.lateral / 1e3, label=plain(curve.label), **look)
            along.plot(curve.slip_ratio, curve.longitudinal / 1e3, **look)
        for axes in (side, along):
            axes.axhline(0, color=GUIDE, linewidth=0.5, zorder=1)
            axes.axvline(0, color=GUIDE, linewidth=0.5, zorder=1)
        side.set_xlabel("slip angle (°)")
        along.set_xlabel("slip ratio (1)")
        side.set_ylabel("force of one wheel (kN)")
        side.set_title("lateral", fontsize=8)
        along.set_title("longitudinal", fontsize=8)
        legend_below(figure)
    return figure
