"""The settings of every stage: frozen, typed, bounded, with the paper's values as defaults.

The allowed names are literals, so that `koop --help` needs no numerics; a test holds them equal to the registries.
A stage's settings are part of its key. Whatever does not change a result is not in here (the size of a chunk moves last
bits), and ``settled`` gives a setting that another one switches off its default, so that it is not in the key either.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from koopcli.checks import setting
from koopcli.config.samples import LARGEST, SEED_LIMIT, Draw, Excitation, PlantName
from koopcli.vehicles.parameters import MagicFormula, VehicleParameters

ForcePer = Literal["axle", "wheel"]
BasisName = Literal["tensor", "total", "anisotropic", "thin-plate", "states"]
Terms = Literal["linear", "bilinear", "generator"]
Placement = Literal["k-means", "drawn"]
Solver = Literal["orthonormal", "cholesky-monomials"]
Boundary = Literal["thin-plate", "optimal"]
LiftName = Literal["nearest"]
Scaling = Literal["raw", "extent"]
BaselineKind = Literal["hold", "rotation", "linearisation"]
FigureName = Literal[
    "single-track",
    "tyre",
    "orders",
    "best-order",
    "random-input",
    "energy-surface",
    "error-map",
    "error-side",
    "mean-trajectory",
    "rmse-histogram",
    "horizon",
    "compare",
    "density",
    "spectrum",
]
ImageFormat = Literal["png", "svg", "pdf"]


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

    order: int = setting(
        7, low=1, high=1000, help="highest degree: of each state, of a product (total), of the yaw rate (anisotropic)"
    )
    basis: BasisName = setting("tensor", help="family of observables; states alone is dynamic mode decomposition")
    degree_velocity: int = setting(1, low=0, high=1000, help="anisotropic: highest degree of v_x and v_y together")
    centres: int = setting(500, low=1, high=100_000, help="thin-plate: number of splines")
    placement: Placement = setting(
        "k-means", help="thin-plate: centres are means of clusters of the data, or drawn from a normal distribution"
    )
    seed: int = setting(0, low=0, high=SEED_LIMIT, help="thin-plate: seed of the centres")
    terms: Terms = setting("linear", help="how inputs act: B u; with u_i N_i z; or so in continuous time")
    ridge: float = setting(0.0, low=0, high=1e6, help="penalty on the coefficients, of the scaled columns' size")
    solver: Solver = setting(
        "orthonormal", help="least squares; cholesky-monomials shows where the textbook's normal equations end"
    )

    def settled(self) -> FitEdmd:
        """The same fit with everything that its basis does not use at its default."""
        idle = {name for names in OF_BASIS.values() for name in names} - set(OF_BASIS[self.basis])
        return replace(self, **{name: getattr(FitEdmd, name) for name in idle})


OF_BASIS: dict[str, tuple[str, ...]] = {
    "tensor": ("order",),
    "total": ("order",),
    "anisotropic": ("order", "degree_velocity"),
    "thin-plate": ("centres", "placement", "seed"),
    "states": (),
}


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
    restart: int | None = setting(
        None, low=1, high=1_000_000, help="steps until a prediction starts afresh from the true state; else never"
    )


@dataclass(frozen=True)
class Series:
    """What one of several artefacts is called in a figure, and the order of its basis where it is drawn against it."""

    label: str
    order: int | None = None


@dataclass(frozen=True)
class Tyres:
    """What a figure draws of a vehicle's tyres: ``loads`` of a front and of a rear wheel in N, and its formulas."""

    label: str
    loads: tuple[float, ...]
    mu_scale: float
    lateral: MagicFormula
    longitudinal: MagicFormula


@dataclass(frozen=True)
class PlotOptions:
    """What figures can be told."""

    restart: int = setting(50, low=1, high=1_000_000, help="random-input: steps until the prediction starts afresh")


@dataclass(frozen=True)
class Plot:
    """A figure, what it is told beside its inputs, and the digest of the code that draws it."""

    figure: FigureName
    format: ImageFormat
    drawn_by: str
    series: tuple[Series, ...] = setting((), empty=True)
    tyres: tuple[Tyres, ...] = setting((), empty=True)
    restart: int | None = None


@dataclass(frozen=True)
class Reproduce:
    """What `koop reproduce` sweeps over."""

    orders: tuple[int, ...] = setting(tuple(range(1, 11)), low=1, high=1000, unique=True, help="edmd: basis orders")
    draws: tuple[Draw, ...] = setting(("random", "even"), unique=True, help="edmd: kinds of training grid")
    draw_seeds: tuple[int, ...] = setting(
        (0, 1, 2), low=0, high=SEED_LIMIT, unique=True, help="edmd: seeds of the random training grids"
    )
    training_forces: tuple[float, ...] = setting(
        (1.0, 100.0, 1e3, 1e4), low=0, high=LARGEST, unique=True, unit="N", help="edmd: sizes of training forces"
    )
    full: bool = setting(False, help="edmd: also the best order over many random training grids")
    full_draws: int = setting(30, low=1, high=100_000, help="edmd: how many, with seeds from 0")
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
