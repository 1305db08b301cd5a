"""The settings of every stage: frozen, typed, bounded, with the paper's values as defaults.

The allowed names are literals, so that `koop --help` needs no numerics; a test holds them equal to the registries.
A stage's settings are part of its key. Whatever does not change a result is not in here; the size of a chunk is here,
because it moves the last bits of a score and says which rows a committed part holds. ``settled`` resets settings that
have no effect, so that they are not in the key.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from koopcli.checks import setting
from koopcli.config.plants import UNUSED, PlantName, used_of
from koopcli.config.sampled import LARGEST, SEED_LIMIT, Draw, Excitation, Mirror
from koopcli.vehicles.options import CUSTOMARY
from koopcli.vehicles.parameters import VehicleParameters

ForcePer = Literal["axle", "wheel"]
Combined = Literal["none", "ellipse"]
BasisName = Literal["tensor", "total", "anisotropic", "thin-plate", "states"]
Terms = Literal["linear", "bilinear", "generator"]
Placement = Literal["k-means", "drawn"]
Solver = Literal["orthonormal", "cholesky-monomials"]
Boundary = Literal["thin-plate", "optimal"]
Eigenvalues = Literal["dmd", "comb", "varpro"]
Window = Literal["trajectory", "horizon"]
LiftName = Literal["nearest", "linear", "mls", "polyharmonic"]
Coordinates = Literal["state", "world"]
Scaling = Literal["raw", "extent"]
BaselineKind = Literal["hold", "rotation", "linearisation"]
FitName = Literal["fit-edmd", "fit-eigen"]
CHUNKS = {"forces": 500_000, "slips": 200_000, "wheels": 200_000}  # samples; fewer at a time take longer each


@dataclass(frozen=True)
class About:
    """What an experiment is about. It is part of no key: a fit is the same, whoever asks for it."""

    fit: FitName | None = setting(
        None, help="the fit that evaluate, sweep and plot make; else fit-edmd, and in figures the one they are for"
    )


@dataclass(frozen=True)
class Simulate:
    """A plant with its vehicle, integrated from a sample."""

    vehicle: VehicleParameters
    plant: PlantName | None = setting(None, help="equations of motion; else those the sample is for")
    force_per: ForcePer = setting("axle", help="forces: what one input force acts on")
    v_eps: float | None = setting(
        None,
        above=0,
        high=100,
        unit="m/s",
        help="a wheel slower than this counts as that fast in its slips; else 0.1 (slips) or 0.5 (wheels)",
    )
    combined: Combined | None = setting(
        None, help="how forces along and across a wheel share its grip; else none (slips) or ellipse (wheels)"
    )
    brake_width: float | None = setting(
        None, above=0, high=1e3, unit="rad/s", help="wheels: wheel rate over which brake torques turn; else 1"
    )
    dt: float = setting(0.01, above=0, high=10, unit="s", help="sampling period")
    steps: int | None = setting(None, low=1, high=1_000_000, help="steps of each trajectory; else as the sample has")
    reference: bool = setting(False, help="integrate by a solver that controls its error, to compare with")
    chunk: int | None = setting(
        None,
        low=1,
        high=10**9,
        help="samples for each committed part, a hundredth of them for the reference; else 500000 (forces) or 200000",
    )

    def settled(self) -> Simulate:
        """The same simulation: what is left open is written out as its plant has it, what has no effect is reset."""
        plant = self.plant or "forces"
        own = {name.partition(".")[2] for name in UNUSED[plant] if name.startswith("simulate.")}
        idle = {name: getattr(Simulate, name) for name in own}
        open_ = {name: value for name, value in CUSTOMARY[plant].items() if getattr(self, name) is None}
        chunk = CHUNKS[plant] if self.chunk is None else self.chunk
        return replace(self, vehicle=used_of(self.vehicle, plant), chunk=chunk, **{**idle, **open_})


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

    chunk: int = setting(
        1_000_000, low=1, high=10**9, help="samples for each committed part of sums; a product dataset has none"
    )

    def settled(self) -> FitEdmd:
        """The same fit: what its basis does not use is reset."""
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

    eigenvalues: Eigenvalues = setting(
        "dmd", help="rates: sums of the data's own, a comb of frequencies, or those that a search finds from there"
    )
    degree: int = setting(2, low=0, high=100, help="dmd: most rates of the dynamic mode decomposition in one sum")
    pairs: int | None = setting(
        None, low=1, high=1000, help="comb, varpro: pairs of complex rates beside two real ones; else 10 and 6"
    )
    lowest: float = setting(2.0, above=0, high=1e6, unit="rad/s", help="comb, varpro: lowest frequency")
    highest: float = setting(26.0, above=0, high=1e6, unit="rad/s", help="comb, varpro: highest frequency")
    damping: float = setting(1.0, low=0, high=1e6, unit="1/s", help="comb, varpro: decay of all but the constant")
    window: Window = setting(
        "trajectory", help="what a lifted state is fitted to: the trajectory from Γ, or the horizon ahead of a sample"
    )
    boundary: Boundary = setting("thin-plate", help="values on Γ: thin-plate splines of x0, or the best ones")
    centres: int = setting(441, low=1, high=100_000, help="thin-plate: number of splines")
    seed: int = setting(0, low=0, high=SEED_LIMIT, help="thin-plate: seed of their centres")
    scaling: Scaling = setting("raw", help="thin-plate: distances in raw SI units, or in half-widths of the data")
    cut: float | None = setting(
        None, low=0, high=0.5, help="smallest singular value kept, of the largest; else 1e-14 (thin-plate) or rounding"
    )
    tabulate: float = setting(1.0, above=0, high=1e6, unit="s", help="length of each trajectory that is looked up")
    horizon: float | None = setting(
        None, above=0, high=1e6, unit="s", help="window horizon: longest prediction; else what the table leaves"
    )
    lift: LiftName = setting("nearest", help="how a state is looked up")
    coordinates: Coordinates = setting(
        "state", help="window horizon: what is interpolated, the states or the motion in the world"
    )
    neighbours: int | None = setting(None, low=1, high=10_000, help="mls, polyharmonic: nodes at a time; else 24, 60")
    nodes: int | None = setting(
        None, low=1, high=1_000_000, help="samples looked up of each trajectory, thinned by voxels; else all"
    )
    spacing: int | None = setting(
        None, low=1, high=1_000_000, help="mls, polyharmonic: samples between neighbours on one trajectory; else any"
    )
    radial_power: float = setting(
        1.0, above=0, high=10, help="distances: power of the distance from standstill; below 1 the middle is spread out"
    )
    mirror: tuple[Mirror, ...] = setting((), unique=True, empty=True, help="mirror images that are data too")
    rounds: int = setting(
        0, low=0, high=100, help="window horizon: how often short trajectories are continued by the predictor itself"
    )
    trust: bool = setting(False, help="window horizon: estimate errors from data held back")

    def settled(self) -> FitEigen:
        """The same fit: what is left open is written out, what has no effect is reset."""
        idle = {name: getattr(FitEigen, name) for name in self.idle()}
        found = replace(self, **{**idle, **({"boundary": "optimal"} if "boundary" in idle else {})})
        if found.boundary == "thin-plate" and found.cut is None:
            found = replace(found, cut=1e-14)
        if found.eigenvalues in PAIRS and found.pairs is None:
            found = replace(found, pairs=PAIRS[found.eigenvalues])
        if found.lift in NEIGHBOURS and found.neighbours is None:
            found = replace(found, neighbours=NEIGHBOURS[found.lift])
        return found

    def idle(self) -> dict[str, str]:
        """The settings that have no effect, each with the one that switches it off."""
        spline = ("centres", "seed", "scaling")
        off: dict[str, str] = {}
        if self.window == "horizon":
            off |= dict.fromkeys(("boundary", *spline), "window")
        else:
            off |= dict.fromkeys(("horizon", "coordinates", "rounds", "trust"), "window")
            if self.boundary == "optimal":
                off |= dict.fromkeys(spline, "boundary")
        off |= dict.fromkeys(
            ("degree",) if self.eigenvalues in PAIRS else ("pairs", "lowest", "highest", "damping"), "eigenvalues"
        )
        return off if self.lift in NEIGHBOURS else {**off, "neighbours": "lift", "spacing": "lift"}


PAIRS = {"comb": 10, "varpro": 6}  # of complex rates, unless told otherwise
NEIGHBOURS = {"mls": 24, "polyharmonic": 60}  # at a time, unless told otherwise


@dataclass(frozen=True)
class Baseline:
    """A baseline: a prediction without any fit."""

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
    relift: bool = setting(True, help="score predictions that are lifted afresh at every step too")
    restart: int | None = setting(
        None, low=1, high=1_000_000, help="steps until a prediction starts afresh from the true state; else never"
    )


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
    unseen: tuple[str, ...] = setting(
        ("efremov-2020", "bmw-320i"),
        unique=True,
        empty=True,
        help="beyond: vehicles for the best fit alone",
    )
    pairs: tuple[int, ...] = setting(
        (1, 2, 3, 4, 6, 8, 10), low=1, high=1000, unique=True, help="beyond: pairs of rates of the mode sweep"
    )
    budgets: tuple[float, ...] = setting(
        (441.0, 100.0, 2000.0),
        above=0,
        high=1e9,
        unique=True,
        unit="s",
        help="beyond: simulated seconds, the main first",
    )


@dataclass(frozen=True)
class SweepAxis:
    """One swept setting by its full ``name``, and its ``values`` as they are written on the command line."""

    name: str
    values: tuple[str, ...]


@dataclass(frozen=True)
class Sweep:
    """A grid of settings. ``places``: of each cell the place of its value on each axis, -1 where it has no effect."""

    axes: tuple[SweepAxis, ...]
    places: tuple[tuple[int, ...], ...]
