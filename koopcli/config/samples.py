"""The settings of every kind of sample, and which kinds go with which plant."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from koopcli.checks import setting
from koopcli.config.driving import DriveSample, DriveTestSample, ManoeuvreSample
from koopcli.config.plants import PlantName, used_of
from koopcli.config.sampled import (
    BOX,
    ENERGY,
    LARGEST,
    SEED_LIMIT,
    Draw,
    Excitation,
    Kind,
    Layout,
    Mesh,
    Mirror,
    Sampled,
)
from koopcli.vehicles.parameters import VehicleParameters


@dataclass(frozen=True)
class GridSample(Sampled):
    """The EDMD dataset: every state of a grid with every input column."""

    kind: Literal["grid"] = "grid"
    seed: int = setting(0, low=0, high=SEED_LIMIT, help="seed of every draw")
    count: int = setting(15, low=1, high=10_000, help="values per state")
    draw: Draw = setting("random", help="how the values of a state are chosen")
    box: tuple[float, ...] = setting(BOX, low=1e-6, high=LARGEST, help="half-width per state: m/s, m/s, rad/s")
    levels: tuple[float, ...] = setting((1.0, 5.0, 10.0, 100.0), low=0, high=LARGEST, unit="N", help="input ranges F_m")
    columns: int = setting(15, low=1, high=100_000, help="input columns per range")

    @property
    def driven(self) -> bool:
        """Whether inputs change within or between its trajectories."""
        return max(self.levels) > 0 and len(self.levels) * self.columns > 1

    @property
    def trajectories(self) -> int:
        """How many trajectories start from the sample."""
        return int(self.count ** len(self.box)) * len(self.levels) * self.columns

    @property
    def horizon(self) -> int:
        """Steps of each trajectory unless told otherwise."""
        return 1

    @property
    def numbers(self) -> int:
        """How many numbers the sample stores."""
        return self.count * len(self.box) + 4 * len(self.levels) * self.columns


@dataclass(frozen=True)
class BoxSample(Sampled):
    """Test states uniform in a box, with inputs."""

    kind: Literal["box"] = "box"
    seed: int = setting(7, low=0, high=SEED_LIMIT, help="seed of every draw")
    count: int = setting(3375, low=1, high=100_000_000, help="number of states")
    excitation: Excitation = setting("fresh", help="inputs: none, fresh at each step, or held")
    amplitude: float = setting(1e4, low=0, high=LARGEST, unit="N", help="inputs are uniform in ± amplitude")
    steps: int = setting(30, low=1, high=1_000_000, help="steps of each trajectory")
    box: tuple[float, ...] = setting(BOX, low=1e-6, high=LARGEST, help="half-width per state: m/s, m/s, rad/s")
    layout: Layout = setting("uniform", help="states uniform in the box, or the product of values drawn per state")

    @property
    def driven(self) -> bool:
        """Whether inputs change within or between its trajectories."""
        return self.excitation != "none" and self.amplitude > 0

    @property
    def input_steps(self) -> int | None:
        """Steps that the sample holds inputs for, None for any number."""
        return self.steps if self.excitation == "fresh" else None

    @property
    def numbers(self) -> int:
        """How many numbers the sample stores."""
        return self.count * (len(self.box) + 4 * (self.input_steps or 1))

    def settled(self) -> BoxSample:
        """The same sample: an amplitude without inputs is reset to zero."""
        return replace(self, amplitude=0.0) if self.excitation == "none" else self


@dataclass(frozen=True)
class PointSample(Sampled):
    """One initial state with inputs: the paper's single trajectory."""

    kind: Literal["point"] = "point"
    seed: int = setting(0, low=0, high=SEED_LIMIT, help="seed of the inputs")
    x0: tuple[float, ...] = setting(
        (20.8533, -0.7222, -4.3479), low=-LARGEST, high=LARGEST, help="initial state: m/s, m/s, rad/s"
    )
    excitation: Excitation = setting("fresh", help="inputs: none, fresh at each step, or held")
    amplitude: float = setting(1e4, low=0, high=LARGEST, unit="N", help="inputs are uniform in ± amplitude")
    steps: int = setting(300, low=1, high=1_000_000, help="steps of the trajectory")

    @property
    def driven(self) -> bool:
        """Whether inputs change within or between its trajectories."""
        return self.excitation != "none" and self.amplitude > 0

    @property
    def trajectories(self) -> int:
        """How many trajectories start from the sample."""
        return 1

    @property
    def input_steps(self) -> int | None:
        """Steps that the sample holds inputs for, None for any number."""
        return self.steps if self.excitation == "fresh" else None

    @property
    def numbers(self) -> int:
        """How many numbers the sample stores."""
        return len(self.x0) + 4 * (self.input_steps or 1)

    def settled(self) -> PointSample:
        """The same sample: an amplitude without inputs is reset to zero."""
        return replace(self, amplitude=0.0) if self.excitation == "none" else self


@dataclass(frozen=True, kw_only=True)
class EllipsoidSample(Sampled):
    """Γ: states of one kinetic energy, the surface that trajectories of the eigenfunction method start from."""

    kind: Literal["ellipsoid"] = "ellipsoid"
    mesh: Mesh = setting("sphere", help="points on the surface: latitudes × longitudes, or a spiral")
    count: int = setting(441, low=10, high=1_000_000, help="number of states; a square for the mesh 'sphere'")
    shells: int = setting(1, low=1, high=1000, help="surfaces, of radii even from a quarter to the whole")
    energy: float = setting(ENERGY, above=0, high=LARGEST, unit="J", help="(largest) kinetic energy")
    steps: int = setting(150, low=1, high=1_000_000, help="steps of each trajectory")
    m: float
    Jzz: float

    @property
    def trajectories(self) -> int:
        """How many trajectories start from the sample."""
        return self.count * self.shells

    @property
    def numbers(self) -> int:
        """How many numbers the sample stores."""
        return 7 * self.trajectories


@dataclass(frozen=True, kw_only=True)
class GreedySample(Sampled):
    """States inside Γ, each the farthest from the data that trajectories from those before it give."""

    kind: Literal["greedy"] = "greedy"
    seed: int = setting(0, low=0, high=SEED_LIMIT, help="seed of the candidates")
    budget: float = setting(441.0, above=0, high=1e9, unit="s", help="simulated seconds of all trajectories together")
    steps: int = setting(100, low=1, high=1_000_000, help="steps of each trajectory")
    usable: float = setting(0.5, above=0, high=1e6, unit="s", help="length of each trajectory that counts as data")
    candidates: int = setting(20_000, low=1, high=10_000_000, help="states to choose from, uniform in the volume")
    mirror: tuple[Mirror, ...] = setting((), unique=True, empty=True, help="mirror images that count as data too")
    energy: float = setting(ENERGY, above=0, high=LARGEST, unit="J", help="largest kinetic energy")
    vehicle: VehicleParameters
    dt: float
    v_eps: float

    @property
    def m(self) -> float:
        """Mass in kg."""
        return self.vehicle.m

    @property
    def Jzz(self) -> float:
        """Yaw inertia in kg m²."""
        return self.vehicle.Jzz

    @property
    def count(self) -> int:  # type: ignore[override]
        """How many trajectories the budget pays for."""
        return int(self.budget / (self.steps * self.dt) + 1e-9)

    def settled(self) -> GreedySample:
        """The same sample: what the plant does not use of the vehicle is reset."""
        return replace(self, vehicle=used_of(self.vehicle, SAMPLED_FOR[self.kind]))


@dataclass(frozen=True, kw_only=True)
class BallSample(Sampled):
    """Test states uniform in the volume inside Γ, without inputs."""

    kind: Literal["ball"] = "ball"
    seed: int = setting(0, low=0, high=SEED_LIMIT, help="seed of every draw")
    count: int = setting(2000, low=1, high=100_000_000, help="number of states")
    energy: float = setting(ENERGY, above=0, high=LARGEST, unit="J", help="largest kinetic energy")
    steps: int = setting(50, low=1, high=1_000_000, help="steps of each trajectory")
    m: float
    Jzz: float


SampleSettings = (
    GridSample
    | BoxSample
    | PointSample
    | EllipsoidSample
    | GreedySample
    | BallSample
    | DriveSample
    | DriveTestSample
    | ManoeuvreSample
)

SAMPLES: dict[str, type[SampleSettings]] = {
    "grid": GridSample,
    "box": BoxSample,
    "point": PointSample,
    "ellipsoid": EllipsoidSample,
    "greedy": GreedySample,
    "ball": BallSample,
    "drive": DriveSample,
    "drive-test": DriveTestSample,
    "manoeuvre": ManoeuvreSample,
}
OF_VEHICLE = ("m", "Jzz", "r_w")  # what samples by kinetic energy and those of rolling wheels take from the vehicle
OF_SIMULATION = ("vehicle", "dt", "v_eps")  # what one that simulates, or steers, takes from the simulation
ELSEWHERE = {**dict.fromkeys(OF_VEHICLE, "vehicle"), **dict.fromkeys(OF_SIMULATION, "simulate"), "vehicle": "vehicle"}


@dataclass(frozen=True)
class Custom:
    """What is done with a plant unless told otherwise: kinds of training and test sample, first scored sample k."""

    training: Kind
    test: Kind
    first: int


CUSTOMS: dict[str, Custom] = {
    "forces": Custom("grid", "box", first=1),  # the states are observables, so k = 0 is exact
    "slips": Custom("ellipsoid", "ball", first=0),  # k = 0 is an approximation already
    "wheels": Custom("drive", "drive-test", first=1),
}

SAMPLED_FOR: dict[str, PlantName] = {
    "grid": "forces",
    "box": "forces",
    "point": "forces",
    "ellipsoid": "slips",
    "greedy": "slips",
    "ball": "slips",
    "drive": "wheels",
    "drive-test": "wheels",
    "manoeuvre": "wheels",
}
