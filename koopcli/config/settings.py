"""The settings of every stage: frozen, typed, bounded, with the paper's values as defaults.

The allowed names are literals, so that `koop --help` needs no numerics; a test holds them equal to the registries.
A stage's settings are part of its key. Whatever does not change a result is not in here.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from koopcli.checks import setting
from koopcli.vehicles.parameters import VehicleParameters

Kind = Literal["grid", "box"]
Draw = Literal["random", "even"]
Excitation = Literal["none", "fresh", "held"]
PlantName = Literal["forces"]
ForcePer = Literal["axle", "wheel"]
BasisName = Literal["tensor"]
FigureName = Literal["orders"]
ImageFormat = Literal["png", "svg", "pdf"]

BOX = (30.0, 30.0, 10.0)
SEED_LIMIT = 2**63 - 1
LARGEST = 1e12  # of any physical quantity: squares and sums of it stay far inside the floating-point range


@dataclass(frozen=True)
class GridSample:
    """The EDMD dataset: every state of a grid with every input column."""

    kind: Literal["grid"] = "grid"
    seed: int = setting(0, low=0, high=SEED_LIMIT, help="seed of every draw")
    count: int = setting(15, low=1, high=10_000, help="values per state")
    draw: Draw = setting("random", help="how the values of a state are chosen")
    box: tuple[float, ...] = setting(BOX, low=1e-6, high=LARGEST, help="half-width per state: m/s, m/s, rad/s")
    levels: tuple[float, ...] = setting((1.0, 5.0, 10.0, 100.0), low=0, high=LARGEST, unit="N", help="input ranges F_m")
    columns: int = setting(15, low=1, high=100_000, help="input columns per range")

    @property
    def trajectories(self) -> int:
        """How many trajectories start from the sample."""
        return int(self.count ** len(self.box)) * len(self.levels) * self.columns

    @property
    def horizon(self) -> int:
        """Steps of each trajectory unless told otherwise."""
        return 1


@dataclass(frozen=True)
class BoxSample:
    """Test states uniform in a box, with inputs."""

    kind: Literal["box"] = "box"
    seed: int = setting(7, low=0, high=SEED_LIMIT, help="seed of every draw")
    count: int = setting(3375, low=1, high=100_000_000, help="number of states")
    excitation: Excitation = setting("fresh", help="inputs: none, fresh at each step, or held")
    amplitude: float = setting(1e4, low=0, high=LARGEST, unit="N", help="inputs are uniform in ± amplitude")
    steps: int = setting(30, low=1, high=1_000_000, help="steps of each trajectory")
    box: tuple[float, ...] = setting(BOX, low=1e-6, high=LARGEST, help="half-width per state: m/s, m/s, rad/s")

    @property
    def trajectories(self) -> int:
        """How many trajectories start from the sample."""
        return self.count

    @property
    def horizon(self) -> int:
        """Steps of each trajectory unless told otherwise."""
        return self.steps

    def settled(self) -> BoxSample:
        """The same sample with the amplitude that does not matter at zero: one sample, one key."""
        return replace(self, amplitude=0.0) if self.excitation == "none" else self


SAMPLES: dict[str, type[GridSample] | type[BoxSample]] = {"grid": GridSample, "box": BoxSample}


@dataclass(frozen=True)
class Simulate:
    """A plant with its vehicle, integrated from a sample."""

    vehicle: VehicleParameters
    plant: PlantName = setting("forces", help="equations of motion")
    force_per: ForcePer = setting("axle", help="what one input force acts on")
    dt: float = setting(0.01, above=0, high=10, unit="s", help="sampling period, one RK4 step")
    steps: int | None = setting(None, low=1, high=1_000_000, help="steps of each trajectory; else as the sample has")


@dataclass(frozen=True)
class FitEdmd:
    """EDMD with inputs."""

    order: int = setting(7, low=1, high=1000, help="highest degree of each state")
    basis: BasisName = setting("tensor", help="family of observables")


@dataclass(frozen=True)
class Evaluate:
    """Scores on test trajectories, committed part by part."""

    first: int = setting(1, low=0, high=1_000_000, help="first scored sample")
    chunk: int = setting(2048, low=1, high=100_000_000, help="trajectories for each committed part")


@dataclass(frozen=True)
class Series:
    """What one evaluation is in the figure of errors against order."""

    order: int
    draw: str
    excitation: str


@dataclass(frozen=True)
class Plot:
    """A figure, what it draws of each input, and the digest of the code that draws it."""

    figure: FigureName
    format: ImageFormat
    series: tuple[Series, ...]
    drawn_by: str


@dataclass(frozen=True)
class Reproduce:
    """What `koop reproduce edmd` sweeps over."""

    orders: tuple[int, ...] = setting(tuple(range(1, 11)), low=1, high=1000, unique=True, help="basis orders")
    draws: tuple[Draw, ...] = setting(("random", "even"), unique=True, help="kinds of training grid")
    excitations: tuple[Excitation, ...] = setting(("none", "fresh", "held"), unique=True, help="test inputs")
