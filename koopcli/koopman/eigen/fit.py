"""Koopman eigenfunctions from data (docs/equations.md 7): from trajectories to a predictor."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from koopcli.checks import Settings
from koopcli.choices import setting
from koopcli.errors import InvalidValueError
from koopcli.koopman.eigen.forces import Coasting, Driven
from koopcli.koopman.eigen.lookup.lookup import Lift
from koopcli.koopman.eigen.lookup.nearest import NearestLift
from koopcli.koopman.eigen.nodes import Search
from koopcli.koopman.eigen.rates.dmd import Dmd
from koopcli.koopman.eigen.rates.rates import Rates, Windows, check_growth
from koopcli.koopman.eigen.windows import AlongTrajectory, Window, whole
from koopcli.koopman.predictor.modes import Modes, newton_couplings
from koopcli.koopman.predictor.predictor import Predictor
from koopcli.progress import Progress, silent
from koopcli.records import FloatArray, Trajectories
from koopcli.vehicles.symmetry import Mirror


@dataclass(frozen=True)
class FitEigen(Settings):
    """Eigenfunctions from trajectories."""

    eigenvalues: Rates = setting(Dmd(), option=True, help="rates of growth")
    window: Window = setting(AlongTrajectory(), option=True, help="what a lifted state is fitted to")
    tabulate: float = setting(
        1.0,
        above=0,
        high=1e6,
        unit="s",
        option=True,
        help="length of each trajectory in which a state is looked up; what is simulated beyond is the longest "
        "prediction",
    )
    lift: Lift = setting(NearestLift(), option=True, help="how a state is looked up")
    nodes: int | None = setting(
        None, low=1, high=1_000_000, help="samples looked up of each trajectory, thinned by voxels; else all"
    )
    radial_power: float = setting(
        1.0, above=0, high=10, help="distances: power of the distance from standstill; below 1 the middle is spread out"
    )
    scale: tuple[float, ...] = setting(
        (),
        empty=True,
        above=0,
        high=1e6,
        help="distances: the unit of each state, as a share of its largest magnitude; else all of that",
    )
    mirror: tuple[Mirror, ...] = setting(
        (),
        unique=True,
        empty=True,
        option=True,
        help="mirror images of the trajectories that are data too: of a car that is the same to the left and to the "
        "right, or at both axles",
    )
    smooth: bool | None = setting(
        None, option=True, help="smooth each trajectory and choose the softness of splines; else where noise is seen"
    )

    inputs: Driven = setting(Coasting(), option=True, help="what moves the predicted car")

    def tabulated(self, dt: float) -> int:
        """Steps of ``dt`` s of each trajectory that are looked up."""
        return whole("tabulate", self.tabulate, dt)

    def search(self, x: FloatArray) -> Search:
        """Distances are in the largest magnitude of each state of ``x`` (J, samples, n_x); those of the nearest sample
        alone in raw units (7.6).
        """
        self.check_scale(x.shape[2])
        size = np.abs(x).max(axis=(0, 1))
        raw = isinstance(self.lift, NearestLift) and self.radial_power == 1.0
        scale = np.ones(x.shape[2]) if raw else np.where(size > 0, size, 1.0)
        return Search(self.lift, scale * np.asarray(self.scale or 1.0), self.radial_power)

    def check_scale(self, states: int) -> None:
        """Raise ``InvalidValueError`` where ``scale`` is not of so many ``states``."""
        if self.scale and len(self.scale) != states:
            raise InvalidValueError(
                f"'fit-eigen.scale' has {len(self.scale)} numbers for {states} states: give one for each"
            )


def fit(trajectories: Trajectories, how: FitEigen, images: int = 1, progress: Progress = silent) -> Predictor:
    """The predictor whose lifted states are eigenfunctions, known at samples and looked up elsewhere (7.1).

    The trajectories are ``images`` times as many as were observed, mirror images after one another. Raises
    ``InvalidValueError`` for inputs that change, trajectories too short for the table or for the number of rates,
    rates that overflow, and data too few for the lift.
    """
    x, dt = autonomous(trajectories), trajectories.dt
    check_window(trajectories.steps, how, dt)
    length = how.window.length(how, trajectories.steps, dt)
    check_modes(how.eigenvalues.count(x.shape[2]), length)
    rates = how.eigenvalues.find(x, _windows(x, length), dt)
    check_growth(rates, length * dt)
    modes = Modes(rates, newton_couplings(rates, length * dt), 1, dt)
    return how.window.fit(trajectories, x, how, modes, images, progress)


def _windows(x: FloatArray, length: int) -> Windows:
    """All windows of ``length`` steps of the trajectories, by where they start."""
    return [x[:, k : k + length + 1] for k in range(x.shape[1] - length)]


def check_window(steps: int, how: FitEigen, dt: float) -> None:
    """Raise ``InvalidValueError`` where a table and the horizon after it do not fit into ``steps``."""
    tabulated, horizon = how.tabulated(dt), how.window.horizon_steps(how, steps, dt)
    lookup_steps = how.window.lookup_steps
    composed = lookup_steps is not None
    if lookup_steps is not None and horizon < lookup_steps <= steps:
        raise InvalidValueError(
            f"'fit-eigen.lookup_steps' of {lookup_steps} is longer than the horizon of {horizon} steps: leave it "
            "out to look the whole horizon up at once"
        )
    if lookup_steps is not None and lookup_steps > steps:
        raise InvalidValueError(
            f"'fit-eigen.lookup_steps' of {lookup_steps} is longer than trajectories of {steps} steps: look up "
            "fewer, or simulate more"
        )
    if tabulated >= steps and not (how.window.rounds or composed):
        raise InvalidValueError(
            f"'fit-eigen.tabulate' of {tabulated * dt:g} s leaves nothing of trajectories of {steps * dt:g} s: a "
            "looked-up state is followed to the end of its trajectory; tabulate less, or simulate more steps"
        )
    if horizon > steps:
        raise InvalidValueError(
            f"'fit-eigen.horizon' of {horizon * dt:g} s is longer than trajectories of {steps * dt:g} s: simulate more "
            "steps, or ask for a shorter horizon"
        )
    if tabulated + horizon > steps and not (how.window.rounds or composed):
        raise InvalidValueError(
            f"trajectories of {steps * dt:g} s do not hold the horizon of {horizon * dt:g} s after each of the first "
            f"{tabulated * dt:g} s: tabulate less, simulate more steps, continue them (fit-eigen.rounds), or compose "
            "shorter lookups (fit-eigen.lookup_steps)"
        )
    if tabulated > steps:
        raise InvalidValueError(
            f"'fit-eigen.tabulate' of {tabulated * dt:g} s is longer than trajectories of {steps * dt:g} s: tabulate "
            "less, or simulate more steps"
        )


def check_modes(modes: int, steps: int) -> None:
    """Raise ``InvalidValueError`` for more ``modes`` than samples to tell them apart."""
    if modes > steps:
        raise InvalidValueError(
            f"{modes:,} rates are too many for windows of {steps} steps, which cannot tell them apart: lower "
            "fit-eigen.degree or fit-eigen.pairs, or simulate more steps"
        )


def autonomous(trajectories: Trajectories) -> FloatArray:
    """All states (J, samples, n_x), after checking that one constant input drives them all."""
    acting = np.asarray(trajectories.u[0])[0]
    for start in range(0, len(trajectories), 4096):
        u = np.asarray(trajectories.u[start : start + 4096])
        if (u != acting).any():
            j = start + int(np.argmax((u != acting).any(axis=(1, 2))))
            raise InvalidValueError(
                f"the inputs of these trajectories change or differ (trajectory {j}): an eigenfunction e^(λt) g(x0) "
                "belongs to a system that runs by itself; give trajectories without inputs, such as those of kind "
                "'ellipsoid', or fit with fit-edmd"
            )
    x = np.asarray(trajectories.x[:])
    if not np.isfinite(x).all():
        j = int(np.argmin(np.isfinite(x).all(axis=(1, 2))))
        raise InvalidValueError(f"trajectory {j} holds values that are not finite: leave it out")
    return x


def with_images(trajectories: Trajectories, signs: list[FloatArray]) -> Trajectories:
    """The trajectories and their mirror images under each of ``signs`` (n_x,), one kind after another.

    Raises ``InvalidValueError`` for inputs other than zero, which have images of their own.
    """
    if not signs:
        return trajectories
    if np.asarray(trajectories.u[0]).any():
        raise InvalidValueError("mirror images are those of a car that rolls by itself: these trajectories have inputs")
    x, u = np.asarray(trajectories.x[:]), np.asarray(trajectories.u[:])
    more = [x, *(x * sign for sign in signs)]
    return replace(trajectories, x=np.concatenate(more), u=np.concatenate([u] * len(more)), product=None)
