"""What figures there are, and what they are told."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from koopcli.choices import setting
from koopcli.config.shipped import Fingerprint
from koopcli.vehicles.parameters import MagicFormula

ImageFormat = Literal["png", "svg", "pdf"]


@dataclass(frozen=True)
class Series:
    """What one of several artefacts is called in a figure, and where it stands on the axis that it is drawn against."""

    label: str
    at: float | None = None


@dataclass(frozen=True)
class Tyres:
    """What a figure draws of a vehicle's tyres: ``loads`` in N and formulas of a front and of a rear wheel."""

    label: str
    loads: tuple[float, ...]
    mu_scale: float
    lateral: tuple[MagicFormula, ...]
    longitudinal: tuple[MagicFormula, ...]


@dataclass(frozen=True)
class Cone:
    """Where a cone of a course stands, ahead and to the left of the start, in m."""

    X: float
    Y: float


@dataclass(frozen=True)
class Subject:
    """What a figure is of: ``vehicles`` by what is known of them, since their names are in no key; what ``predictors``
    are called, one for each.
    """

    vehicles: tuple[Fingerprint, ...] = setting((), empty=True)
    predictors: tuple[str, ...] = setting((), empty=True)


@dataclass(frozen=True)
class PlotOptions:
    """What figures can be told."""

    restart: int = setting(50, low=1, high=1_000_000, help="random-input: steps until the prediction starts afresh")
    trajectory: int = setting(0, low=0, high=100_000_000, help="trajectory: which one is drawn, counted from 0")


@dataclass(frozen=True)
class Plot:
    """A figure, what it is of and told beside its inputs, and the digest of the code that draws it."""

    figure: str
    format: ImageFormat
    drawn_by: str
    of: Subject = Subject()
    series: tuple[Series, ...] = setting((), empty=True)
    tyres: tuple[Tyres, ...] = setting((), empty=True)
    cones: tuple[Cone, ...] = setting((), empty=True)
    restart: int | None = None
    trajectory: int | None = None
