"""The settings of every stage: frozen, typed, bounded, with the paper's values as defaults.

The allowed names are literals, so that `koop --help` needs no numerics; a test holds them equal to the registries.
A stage's settings are part of its key. Whatever does not change a result is not in here (the size of a chunk moves last
bits), and ``settled`` gives a
setting that another one switches off its default, so that it is not in the key either.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, Self

from koopcli.checks import setting
from koopcli.vehicles.parameters import VehicleParameters

Kind = Literal["grid", "box", "ellipsoid", "ball"]
Draw = Literal["random", "even"]
Mesh = Literal["sphere", "fibonacci"]
Excitation = Literal["none", "fresh", "held"]
PlantName = Literal["forces", "slips"]
ForcePer = Literal["axle", "wheel"]
BasisName = Literal["tensor", "states"]
Boundary = Literal["thin-plate", "optimal"]
LiftName = Literal["nearest"]
Scaling = Literal["raw", "extent"]
BaselineKind = Literal["hold", "rotation", "linearisation"]
FigureName = Literal["orders", "error-map", "mean-trajectory"]
ImageFormat = Literal["png", "svg", "pdf"]

INPUTS = {"none": "no input", "fresh": "fresh inputs", "held": "held inputs"}  # kinds of excitation in words
BOX = (30.0, 30.0, 10.0)
ENERGY = 500e3
SEED_LIMIT = 2**63 - 1
LARGEST = 1e12  # of any physical quantity: squares and sums of it stay far inside the floating-point range


class Sampled:
    """What every kind of sample tells of itself; a kind says only what is different."""

    count: int
    steps: int

    @property
    def trajectories(self) -> int:
        """How many trajectories start from the sample."""
        return self.count

    @property
    def horizon(self) -> int:
        """Steps of each trajectory unless told otherwise."""
        return self.steps

    @property
    def input_steps(self) -> int | None:
        """Steps that the sample holds inputs for, None for any number."""
        return None

    @property
    def numbers(self) -> int:
        """How many numbers the sample stores."""
        return 7 * self.count

    def settled(self) -> Self:
        """The same sample with what does not matter at its default: one sample, one key."""
        return self


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

    @property
    def input_steps(self) -> int | None:
        """Steps that the sample holds inputs for, None for any number."""
        return self.steps if self.excitation == "fresh" else None

    @property
    def numbers(self) -> int:
        """How many numbers the sample stores."""
        return self.count * (len(self.box) + 4 * (self.input_steps or 1))

    def settled(self) -> BoxSample:
        """The same sample with the amplitude that does not matter at zero: one sample, one key."""
        return replace(self, amplitude=0.0) if self.excitation == "none" else self


@dataclass(frozen=True, kw_only=True)
class EllipsoidSample(Sampled):
    """Γ: states of one kinetic energy, the surface that trajectories of the eigenfunction method start from."""

    kind: Literal["ellipsoid"] = "ellipsoid"
    mesh: Mesh = setting("sphere", help="points on the surface: latitudes × longitudes, or a spiral")
    count: int = setting(441, low=10, high=1_000_000, help="number of states; a square for the mesh 'sphere'")
    energy: float = setting(ENERGY, above=0, high=LARGEST, unit="J", help="kinetic energy")
    steps: int = setting(150, low=1, high=1_000_000, help="steps of each trajectory")
    m: float
    Jzz: float


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


SampleSettings = GridSample | BoxSample | EllipsoidSample | BallSample

SAMPLES: dict[str, type[GridSample] | type[BoxSample] | type[EllipsoidSample] | type[BallSample]] = {
    "grid": GridSample,
    "box": BoxSample,
    "ellipsoid": EllipsoidSample,
    "ball": BallSample,
}
OF_VEHICLE = ("m", "Jzz")  # what a sample by kinetic energy takes from the vehicle


@dataclass(frozen=True)
class Custom:
    """What is done with a plant unless told otherwise: kinds of training and test sample, first scored sample k."""

    training: Kind
    test: Kind
    first: int


CUSTOMS: dict[str, Custom] = {
    "forces": Custom("grid", "box", first=1),  # the states are observables, so k = 0 is exact
    "slips": Custom("ellipsoid", "ball", first=0),  # k = 0 is an approximation already
}

SAMPLED_FOR: dict[str, PlantName] = {"grid": "forces", "box": "forces", "ellipsoid": "slips", "ball": "slips"}


@dataclass(frozen=True)
class Simulate:
    """A plant with its vehicle, integrated from a sample."""

    vehicle: VehicleParameters
    plant: PlantName | None = setting(None, help="equations of motion; else those the sample is for")
    force_per: ForcePer = setting("axle", help="forces: what one input force acts on")
    v_eps: float = setting(
        0.1, above=0, high=100, unit="m/s", help="slips: a wheel slower than this counts as that fast"
    )
    dt: float = setting(0.01, above=0, high=10, unit="s", help="sampling period")
    steps: int | None = setting(None, low=1, high=1_000_000, help="steps of each trajectory; else as the sample has")

    def settled(self) -> Simulate:
        """The same simulation with everything that its plant does not use at its default."""
        unused = UNUSED[self.plant or "forces"]
        body = {name.partition(".")[2] for name in unused if name.startswith("vehicle.")}
        own = {name.partition(".")[2] for name in unused if name.startswith("simulate.")}
        vehicle = replace(self.vehicle, **{name: getattr(VehicleParameters, name) for name in body})
        return replace(self, vehicle=vehicle, **{name: getattr(Simulate, name) for name in own})


UNUSED: dict[str, tuple[str, ...]] = {
    "forces": (
        "vehicle.J_R",
        "vehicle.r_w",
        "vehicle.mu_scale",
        "vehicle.lateral",
        "vehicle.longitudinal",
        "simulate.v_eps",
    ),
    "slips": ("vehicle.J_R", "vehicle.r_w", "simulate.force_per"),
}


@dataclass(frozen=True)
class FitEdmd:
    """EDMD with inputs."""

    order: int = setting(7, low=1, high=1000, help="highest degree of each state")
    basis: BasisName = setting("tensor", help="family of observables; states alone is dynamic mode decomposition")

    def settled(self) -> FitEdmd:
        """The same fit with the order that does not matter at one."""
        return replace(self, order=1) if self.basis == "states" else self


@dataclass(frozen=True)
class FitEigen:
    """Eigenfunctions from trajectories."""

    degree: int = setting(2, low=0, high=100, help="most rates of the dynamic mode decomposition in one sum")
    boundary: Boundary = setting("thin-plate", help="values on Γ: thin-plate splines of x0, or the best ones")
    centres: int = setting(441, low=1, high=100_000, help="thin-plate: number of splines")
    seed: int = setting(0, low=0, high=SEED_LIMIT, help="thin-plate: seed of their centres")
    scaling: Scaling = setting("raw", help="thin-plate: distances in raw SI units, or in half-widths of the data")
    cut: float | None = setting(
        None, low=0, high=0.5, help="smallest singular value kept, of the largest; else 1e-14 (thin-plate) or rounding"
    )
    tabulate: float = setting(1.0, above=0, high=1e6, unit="s", help="length of each trajectory that is looked up")
    lift: LiftName = setting("nearest", help="how a state is looked up")

    def settled(self) -> FitEigen:
        """The same fit with the cut written out, and without what the boundary functions do not use."""
        if self.boundary == "thin-plate":
            return self if self.cut is not None else replace(self, cut=1e-14)
        return replace(self, centres=FitEigen.centres, seed=FitEigen.seed, scaling=FitEigen.scaling)


@dataclass(frozen=True)
class Baseline:
    """A prediction that fits nothing."""

    kind: BaselineKind = setting(
        "hold", help="the first state kept, turned at a constant yaw rate, or linearised there"
    )


@dataclass(frozen=True)
class Evaluate:
    """Scores on test trajectories, committed part by part."""

    first: int | None = setting(
        None, low=0, high=1_000_000, help="first scored sample; else 1 for the plant 'forces' and 0 for 'slips'"
    )
    chunk: int = setting(2048, low=1, high=100_000_000, help="trajectories for each committed part")


@dataclass(frozen=True)
class Series:
    """What one evaluation is in a figure: the ``label`` of what it belongs to, and the order of its basis."""

    label: str
    order: int | None


@dataclass(frozen=True)
class Plot:
    """A figure, what it draws of each input, and the digest of the code that draws it."""

    figure: FigureName
    format: ImageFormat
    series: tuple[Series, ...]
    drawn_by: str


@dataclass(frozen=True)
class Reproduce:
    """What `koop reproduce` sweeps over."""

    orders: tuple[int, ...] = setting(tuple(range(1, 11)), low=1, high=1000, unique=True, help="edmd: basis orders")
    draws: tuple[Draw, ...] = setting(("random", "even"), unique=True, help="edmd: kinds of training grid")
    excitations: tuple[Excitation, ...] = setting(("none", "fresh", "held"), unique=True, help="edmd: test inputs")
    seeds: tuple[int, ...] = setting((0, 1, 2, 3), low=0, high=SEED_LIMIT, unique=True, help="eigen: test seeds")
    cuts: tuple[float, ...] = setting(
        (1e-6, 1e-8, 1e-10, 1e-12, 1e-14), low=0, high=0.5, unique=True, help="eigen: cuts of the sensitivity table"
    )
    mu_scales: tuple[float, ...] = setting(
        (0.5, 2.0, 3.0), low=0, high=100, unique=True, help="eigen: factors on the grip of the sensitivity table"
    )
    beside: tuple[str, ...] = setting(
        ("rimac-2018",), unique=True, empty=True, help="eigen: vehicles shown beside the main one"
    )
