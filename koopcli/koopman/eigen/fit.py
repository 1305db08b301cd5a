"""Koopman eigenfunctions from data (docs/equations.md 7): from trajectories to a predictor."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.koopman.bases.thin_plate import draw_centres, thin_plate
from koopcli.koopman.eigen import boundary
from koopcli.koopman.eigen.frames import check_frame
from koopcli.koopman.eigen.futures import Futures
from koopcli.koopman.eigen.held_back import held_back
from koopcli.koopman.eigen.lookup import LOOKUPS
from koopcli.koopman.eigen.nodes import Search, nodes_of
from koopcli.koopman.eigen.rates import RATES, Spectrum, Windows, check_growth
from koopcli.koopman.eigen.tabulated import Tabulated
from koopcli.koopman.predictor.coverage import coverage_of
from koopcli.koopman.predictor.dynamics.diagonal import Diagonal
from koopcli.koopman.predictor.modes import Modes, newton_couplings
from koopcli.koopman.predictor.predictor import Predictor
from koopcli.koopman.predictor.regression import Regression
from koopcli.progress import Progress, silent
from koopcli.records import FloatArray, Trajectories


@dataclass(frozen=True)
class Reading:
    """Everything about a fit but its data.

    ``spectrum``: the rates; ``window``: what a lifted state is fitted to, the whole ``trajectory`` or the ``horizon``
    ahead; ``boundary`` functions ``thin-plate`` (with ``centres`` drawn from ``seed``, in ``raw`` units or scaled by
    the ``extent`` of the data) or ``optimal``; ``cut``: smallest singular value kept, relative to the largest, working
    precision if None; ``tabulated`` steps of each trajectory are looked up, and predictions reach ``horizon`` steps.
    ``lift``, ``power``, ``neighbours``, ``nodes``, ``spacing``: see ``nodes.Search``; ``frame`` in which futures are
    interpolated; ``rounds`` of continuing trajectories that are too short for their table; ``trust``: estimate errors.
    """

    spectrum: Spectrum
    window: str
    boundary: str
    centres: int
    seed: int
    scaling: str
    cut: float | None
    tabulated: int
    horizon: int
    lift: str
    frame: str
    power: float
    neighbours: int | None
    nodes: int | None
    spacing: int | None
    rounds: int
    trust: bool


def fit(trajectories: Trajectories, reading: Reading, images: int = 1, progress: Progress = silent) -> Predictor:
    """The predictor whose lifted states are eigenfunctions, known at samples and looked up elsewhere (7.1).

    The trajectories are ``images`` times as many as were observed, mirror images after one another. Raises
    ``InvalidValueError`` for inputs that change, trajectories too short for the table or for the number of rates,
    rates that overflow, and data too few for the lift.
    """
    x, dt = autonomous(trajectories), trajectories.dt
    check_window(trajectories.steps, reading, dt)
    length = reading.horizon if reading.window == "horizon" else trajectories.steps
    check_modes(reading.spectrum.count(x.shape[2]), length)
    rates = RATES[reading.spectrum.kind](x, _windows(x, length), dt, reading.spectrum)
    check_growth(rates, length * dt)
    modes = Modes(rates, newton_couplings(rates, length * dt), 1, dt)
    if reading.window == "horizon":
        return _ahead(trajectories, x, reading, modes, images, progress)
    return _along(trajectories, x, reading, modes)


def _along(trajectories: Trajectories, x: FloatArray, reading: Reading, modes: Modes) -> Predictor:
    """Eigenfunctions from Γ: what the initial states have is carried along each trajectory."""
    cut = _cut(reading, x.shape[1])
    if reading.boundary == "thin-plate":
        half = np.ptp(x, axis=(0, 1)) / 2
        scale = np.where(half > 0, half, 1.0) if reading.scaling == "extent" else np.ones(x.shape[2])
        centres = draw_centres(x, reading.centres, reading.seed)
        solution = boundary.fit_given(x, thin_plate(x[:, 0], centres, scale), modes, cut)
    else:
        solution = boundary.fit_free(x, modes, cut)
    repeated = replace(modes, copies=solution.starts.shape[1])
    table = x[:, : reading.tabulated + 1]
    nodes = nodes_of(table, table.shape[1], _search(reading, x))
    lift = Tabulated(table, nodes, solution.starts, repeated)
    found = Regression(solution.rank, solution.directions, solution.condition, missed=solution.missed)
    return _predictor(trajectories, reading, lift, solution.C, found)


def _ahead(
    trajectories: Trajectories, x: FloatArray, reading: Reading, modes: Modes, images: int, progress: Progress
) -> Predictor:
    """Lifted states fitted to what follows within the horizon."""
    check_frame(reading.frame, trajectories.state_channels)
    horizon, n_x = reading.horizon, x.shape[2]
    time = boundary.time_part(modes, horizon + 1)
    cut = _cut(reading, horizon + 1)
    onto, modes = boundary.projection(time, cut), replace(modes, copies=n_x)
    search = _search(reading, x)
    known = min(x.shape[1] - 1 - horizon, reading.tabulated)

    def futures(data: FloatArray, samples: int) -> Futures:
        return Futures(data, nodes_of(data, samples, search), reading.frame, onto, modes)

    lift = futures(x, known + 1)
    for _ in range(reading.rounds if reading.tabulated > known else 0):
        ahead = lift.future(x[:, -1])[:, 1 : reading.tabulated - known + 1]
        lift = futures(np.concatenate([x, ahead], axis=1), reading.tabulated + 1)
    C = boundary.read_off(n_x, len(modes.rates))
    rank, condition = int(time.kept(cut).sum()), boundary.condition_of(time.singular)
    regression = Regression(rank, len(modes.rates), condition, missed=boundary.missed_ahead(x, time, cut))
    found = _predictor(trajectories, reading, lift, C, regression)
    if not reading.trust:
        return found
    groups = np.tile(np.arange(len(x) // images), images)

    def predict(part: Futures, x0: FloatArray) -> FloatArray:
        return replace(found, observables=part).predict(x0, steps=horizon)

    return replace(found, trust=held_back(lift, known, groups, predict, progress))


def _predictor(
    trajectories: Trajectories, reading: Reading, lift: Tabulated | Futures, C: FloatArray, regression: Regression
) -> Predictor:
    """What both kinds of lift have in common."""
    return Predictor(
        observables=lift,
        dynamics=Diagonal(lift.modes, len(trajectories.input_channels)),
        C=C,
        dt=trajectories.dt,
        coverage=coverage_of(lift.nodes.states),
        state_channels=trajectories.state_channels,
        input_channels=trajectories.input_channels,
        regression=regression,
        horizon=reading.horizon,
        plant=trajectories.plant,
        beyond=LOOKUPS[reading.lift].beyond,
    )


def _search(reading: Reading, x: FloatArray) -> Search:
    """Distances are in the largest magnitude of each state; those of the nearest sample alone in raw units (7.6)."""
    size = np.abs(x).max(axis=(0, 1))
    raw = reading.lift == "nearest" and reading.power == 1.0
    scale = np.ones(x.shape[2]) if raw else np.where(size > 0, size, 1.0)
    return Search(reading.lift, scale, reading.power, reading.neighbours, reading.nodes, reading.spacing)


def _cut(reading: Reading, samples: int) -> float:
    return float(np.finfo(float).eps * samples) if reading.cut is None else reading.cut


def _windows(x: FloatArray, length: int) -> Windows:
    """All windows of ``length`` steps of the trajectories, by where they start."""
    return [x[:, k : k + length + 1] for k in range(x.shape[1] - length)]


def check_window(steps: int, reading: Reading, dt: float) -> None:
    """Raise ``InvalidValueError`` where a table and the horizon after it do not fit into ``steps``."""
    tabulated, horizon = reading.tabulated, reading.horizon
    if tabulated >= steps and not reading.rounds:
        raise InvalidValueError(
            f"'fit-eigen.tabulate' of {tabulated * dt:g} s leaves nothing of trajectories of {steps * dt:g} s: a "
            "looked-up state is followed to the end of its trajectory; tabulate less, or simulate more steps"
        )
    if horizon > steps:
        raise InvalidValueError(
            f"'fit-eigen.horizon' of {horizon * dt:g} s is longer than trajectories of {steps * dt:g} s: simulate more "
            "steps, or ask for a shorter horizon"
        )
    if tabulated + horizon > steps and not reading.rounds:
        raise InvalidValueError(
            f"trajectories of {steps * dt:g} s do not hold the horizon of {horizon * dt:g} s after each of the first "
            f"{tabulated * dt:g} s: tabulate less, simulate more steps, or continue them (fit-eigen.rounds)"
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
    more = [x, *(x * one for one in signs)]
    return replace(trajectories, x=np.concatenate(more), u=np.concatenate([u] * len(more)), product=None)
