"""Settings of the stages that have no file of their own, with the paper's values as defaults.

A stage's settings are part of its key. Whatever does not change a result is not in here; the size of a chunk is here,
because it moves the last bits of a score and says which rows a committed part holds. ``settled`` resets settings that
have no effect, so that they are not in the key.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from koopcli.choices import SEED_LIMIT, setting, taken_from
from koopcli.koopman.predictor.dynamics.force_driven import InputMatrix
from koopcli.simulation.samples.sample import LARGEST, Excitation
from koopcli.vehicles.parameters import VehicleParameters
from koopcli.vehicles.plants.plant import PlantChoice

BaselineKind = Literal["hold", "rotation", "linearisation"]
FitName = Literal["fit-edmd", "fit-eigen"]


@dataclass(frozen=True)
class About:
    """What an experiment is about. It is part of no key: a fit is the same, whoever asks for it."""

    fit: FitName | None = setting(
        None, help="the fit that evaluate, sweep and plot make; else fit-edmd, and in figures the one they are for"
    )


@dataclass(frozen=True, kw_only=True)
class Simulate:
    """A plant with its vehicle, integrated from a sample."""

    vehicle: VehicleParameters = taken_from("vehicle")
    plant: PlantChoice | None = setting(None, option=True, help="equations of motion; else those the sample is for")
    steps: int | None = setting(
        None, low=1, high=1_000_000, option=True, help="steps of each trajectory; else as the sample has"
    )
    dt: float = setting(0.01, above=0, high=10, unit="s", option=True, help="sampling period")
    reference: bool = setting(
        False,
        option=True,
        help="integrate by a solver that controls its error, slowly, and say how far the usual integration is off",
    )
    noise: float = setting(
        0.0,
        low=0,
        high=1e6,
        unit="m/s",
        option=True,
        help="noise on trajectories as they are stored, of which test sets have none: on rates of turning a tenth of "
        "it in rad/s, on velocities a standard deviation",
    )
    noise_seed: int = setting(0, low=0, high=SEED_LIMIT, help="which noise is drawn")
    noise_memory: float = setting(0.0, low=0, high=0.999, help="share of the noise that stays in the next sample")
    chunk: int | None = setting(
        None,
        low=1,
        high=10**9,
        help="samples for each committed part, a hundredth of them for the reference; else 500000 (forces) or 200000",
    )

    def settled(self, plant: PlantChoice, steps: int) -> Simulate:
        """The same simulation of a ``plant``, over so many ``steps`` where that is open."""
        chunk = plant.chunk if self.chunk is None else self.chunk
        same = self if self.noise else self.clean()
        return replace(same, plant=plant, vehicle=plant.used(self.vehicle), steps=self.steps or steps, chunk=chunk)

    def clean(self) -> Simulate:
        """The same simulation without noise."""
        usual = Simulate
        return replace(self, noise=usual.noise, noise_seed=usual.noise_seed, noise_memory=usual.noise_memory)


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
    relift: bool | None = setting(
        None,
        help="also score predictions that are lifted afresh at every step; else where a lift takes one lookup and no "
        "memory: with several it takes minutes",
    )
    restart: int | None = setting(
        None,
        low=1,
        high=1_000_000,
        option=True,
        help="start the prediction afresh from the true state every so many steps, and score each stretch; of a "
        "predictor driven by forces the test set is then the paper's trajectory under random inputs (kind point)",
    )
    input_matrix: InputMatrix | None = setting(
        None,
        option=True,
        help="where the derivative of the lift is taken of a predictor with force inputs; else as it was fitted",
    )
    every: int | None = setting(
        None,
        low=1,
        high=1_000_000,
        option=True,
        help="samples after which it is taken again; else as it was fitted",
    )


@dataclass(frozen=True)
class Reproduce:
    """What `koop reproduce` sweeps over."""

    orders: tuple[int, ...] = setting(tuple(range(1, 11)), low=1, high=1000, unique=True, help="edmd: basis orders")
    draws: tuple[Literal["random", "even", "chebyshev"], ...] = setting(
        ("random", "even"), unique=True, help="edmd: kinds of training grid"
    )
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
    noises: tuple[float, ...] = setting(
        (0.01, 0.05, 0.1),
        above=0,
        high=1e6,
        unique=True,
        unit="m/s",
        help="beyond: noise of training trajectories",
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
