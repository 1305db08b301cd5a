"""What a lifted state is fitted to: the whole trajectory from Γ, or the horizon ahead (docs/equations.md 7)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np

from koopcli.choices import Choice, setting
from koopcli.errors import InvalidValueError
from koopcli.koopman.eigen import boundary
from koopcli.koopman.eigen.boundary import Boundary, BoundarySplines
from koopcli.koopman.eigen.frames import check_frame
from koopcli.koopman.eigen.futures import Futures
from koopcli.koopman.eigen.held_back import SCORED, held_back
from koopcli.koopman.eigen.lookup.lookup import Lift
from koopcli.koopman.eigen.nodes import Search, nodes_of
from koopcli.koopman.eigen.tabulated import Tabulated
from koopcli.koopman.predictor.coverage import coverage_of
from koopcli.koopman.predictor.dynamics.diagonal import Diagonal
from koopcli.koopman.predictor.modes import Modes
from koopcli.koopman.predictor.predictor import Predictor
from koopcli.koopman.predictor.regression import Regression
from koopcli.koopman.predictor.trust import Trust
from koopcli.progress import Progress, silent
from koopcli.records import Channels, FloatArray, Trajectories

if TYPE_CHECKING:
    from koopcli.koopman.eigen.fit import FitEigen

COMPARED, COMPOSED = 1000, 300  # states at which lookups are compared, and composed ones


class Window(Choice):
    """What a lifted state is fitted to."""

    rounds: int = 0
    """How often trajectories that are too short for their table are continued."""
    lookup_steps: int | None = None
    """Steps that one lookup gives, where several are composed."""

    @property
    def cut(self) -> float | None:
        """The smallest singular value kept, of the largest; working precision if None."""
        raise NotImplementedError

    def name(self, how: FitEigen) -> str:
        """What a predictor with it is called."""
        raise NotImplementedError

    def horizon_steps(self, how: FitEigen, steps: int, dt: float) -> int:
        """The longest prediction, from trajectories of so many ``steps`` of ``dt`` s."""
        return steps - how.tabulated(dt)

    def length(self, how: FitEigen, steps: int, dt: float) -> int:
        """Steps of the windows, in trajectories of so many ``steps`` of ``dt`` s."""
        return steps

    def copies(self, states: int, starts: int) -> int:
        """Blocks of modes of so many ``states``, for so many trajectories."""
        return states

    def check(self, states: Channels) -> None:
        """Raise ``InvalidValueError`` for settings that do not go together, or not with the ``states``."""

    def fit(
        self, trajectories: Trajectories, x: FloatArray, how: FitEigen, modes: Modes, images: int, progress: Progress
    ) -> Predictor:
        """The predictor of ``trajectories`` with the states ``x`` (J, samples, n_x), whose lifted states grow as
        ``modes``. They are ``images`` times as many as were observed, mirror images after one another.
        """
        raise NotImplementedError


@dataclass(frozen=True)
class AlongTrajectory(Window):
    """The whole trajectory from Γ, as in the paper."""

    kind: ClassVar[str] = "trajectory"
    boundary: Boundary = setting(
        BoundarySplines(), option=True, help="values of the eigenfunctions at the initial states"
    )

    @property
    def cut(self) -> float | None:
        """That of the boundary values."""
        return self.boundary.cut

    def name(self, how: FitEigen) -> str:
        """What a predictor with it is called."""
        return f"eigenfunctions, {self.boundary.kind}"

    def copies(self, states: int, starts: int) -> int:
        """One for each boundary function."""
        return self.boundary.copies(states, starts)

    def fit(
        self, trajectories: Trajectories, x: FloatArray, how: FitEigen, modes: Modes, images: int, progress: Progress
    ) -> Predictor:
        """Eigenfunctions from Γ: what the initial states have is carried along each trajectory."""
        solution = self.boundary.solve(x, modes)
        repeated = replace(modes, copies=solution.starts.shape[1])
        table = x[:, : how.tabulated(modes.dt) + 1]
        nodes = nodes_of(table, table.shape[1], how.search(x), how.nodes)
        lift = Tabulated(table, nodes, solution.starts, repeated)
        regression = Regression(solution.rank, solution.directions, solution.condition, missed=solution.missed)
        return _predictor(trajectories, how, lift, solution.C, regression)


@dataclass(frozen=True)
class Ahead(Window):
    """The horizon ahead of each sample."""

    kind: ClassVar[str] = "horizon"
    horizon: float | None = setting(
        None, above=0, high=1e6, unit="s", help="longest prediction; else what the table leaves"
    )
    coordinates: Literal["state", "world"] = setting(
        "state",
        option=True,
        help="interpolate states, or the motion as seen from outside, turned back by the predicted yaw",
    )
    rounds: int = setting(0, low=0, high=100, help="how often short trajectories are continued by the predictor itself")
    lookup_steps: int | None = setting(
        None,
        low=1,
        high=1_000_000,
        option=True,
        help="steps that one lookup gives, the next one beginning where it ends; else the whole horizon at once",
    )
    trust: bool = setting(False, option=True, help="estimate errors from data held back, for a bound at every state")
    cut: float | None = setting(None, low=0, high=0.5, option=True, help=boundary.CUT)

    def name(self, how: FitEigen) -> str:
        """What a predictor with it is called."""
        return f"eigenfunctions, {'' if self.lookup_steps is None else 'composed '}{how.lift.kind}"

    def horizon_steps(self, how: FitEigen, steps: int, dt: float) -> int:
        """The longest prediction."""
        return super().horizon_steps(how, steps, dt) if self.horizon is None else whole("horizon", self.horizon, dt)

    def length(self, how: FitEigen, steps: int, dt: float) -> int:
        """As long as a prediction."""
        return self.horizon_steps(how, steps, dt)

    def check(self, states: Channels) -> None:
        """Raise ``InvalidValueError`` for rounds without a horizon or with composed lookups, which need none, and for a
        frame that the ``states`` do not tell.
        """
        if self.rounds and self.horizon is None:
            raise InvalidValueError(
                "'fit-eigen.rounds' continues trajectories over the horizon: set fit-eigen.horizon too"
            )
        if self.rounds and self.lookup_steps is not None:
            raise InvalidValueError(
                "'fit-eigen.rounds' has no effect with fit-eigen.lookup_steps: a short lookup needs no continuation; "
                "set fit-eigen.rounds=0, or take the experiment best-eigen"
            )
        check_frame(self.coordinates, states)

    def fit(
        self, trajectories: Trajectories, x: FloatArray, how: FitEigen, modes: Modes, images: int, progress: Progress
    ) -> Predictor:
        """Lifted states fitted to what follows within the horizon. The softness of the lookup is chosen first where
        noise was smoothed and it is open.
        """
        check_frame(self.coordinates, trajectories.state_channels)
        tabulated, n_x = how.tabulated(modes.dt), x.shape[2]
        horizon = self.horizon_steps(how, trajectories.steps, modes.dt)
        time = boundary.time_part(modes, horizon + 1)
        cut = boundary.kept(self.cut, horizon + 1)
        onto, modes = boundary.projection(time, cut), replace(modes, copies=n_x)
        known = min(x.shape[1] - 1 - horizon, tabulated)

        def futures(data: FloatArray, samples: int, search: Search) -> Futures:
            nodes = nodes_of(data, samples, search, how.nodes)
            return Futures(data, nodes, self.coordinates, onto, modes, self.lookup_steps)

        def lifted(lookup: Lift) -> Futures:
            search = replace(how, lift=lookup).search(x)
            if self.lookup_steps is not None:
                return futures(x, min(x.shape[1] - 1 - self.lookup_steps, tabulated) + 1, search)
            lift = futures(x, known + 1, search)
            for _ in range(self.rounds if tabulated > known else 0):
                ahead = lift.future(x[:, -1])[:, 1 : tabulated - known + 1]
                lift = futures(np.concatenate([x, ahead], axis=1), tabulated + 1, search)
            return lift

        C = boundary.read_off(n_x, len(modes.rates))
        rank, condition = int(time.kept(cut).sum()), boundary.condition_of(time.singular)
        regression = Regression(rank, len(modes.rates), condition, missed=boundary.missed_ahead(x, time, cut))
        lookups = how.lift.softer() if how.smooth else []
        lift = lifted(lookups[len(lookups) // 2] if lookups else how.lift)
        predictor = _predictor(trajectories, how, lift, C, regression)
        groups = np.tile(np.arange(len(x) // images), images)

        def held(lift: Futures, progress: Progress, scored: int = SCORED) -> Trust:
            def predict(part: Futures, x0: FloatArray) -> FloatArray:
                return replace(predictor, observables=part).predict(x0, steps=horizon)

            return held_back(lift, known, groups, predict, progress, scored)

        if lookups:
            scored = COMPARED if self.lookup_steps is None else COMPOSED

            def mean(place: int) -> float:
                tried = replace(lift, nodes=lift.nodes.looked_up_by(lookups[place]))
                return float(held(tried, silent, scored).errors.mean())

            lift = lifted(lookups[_lowest(mean, len(lookups), progress)])
            predictor = replace(predictor, observables=lift)
        return replace(predictor, trust=held(lift, progress)) if self.trust else predictor


def _lowest(value: Callable[[int], float], places: int, progress: Progress) -> int:
    """The place in a valley where its ``value`` is lowest, from the middle of so many ``places`` downhill."""
    known: dict[int, float] = {}

    def at(place: int) -> float:
        if not 0 <= place < places:
            return math.inf
        if place not in known:
            progress(len(known), places)
            known[place] = value(place)
        return known[place]

    lowest = places // 2
    for step in (1, -1):
        while at(lowest + step) < at(lowest):
            lowest += step
    return lowest


def whole(name: str, seconds: float, dt: float) -> int:
    """A time in steps of ``dt`` s. Raises ``InvalidValueError`` where it is no whole number of them."""
    steps = seconds / dt
    if abs(steps - round(steps)) > 1e-6 * steps or round(steps) < 1:
        raise InvalidValueError(
            f"'fit-eigen.{name}' must be a whole number of sampling periods of {dt:g} s, got {seconds:g} s"
        )
    return round(steps)


def _predictor(
    trajectories: Trajectories, how: FitEigen, lift: Tabulated | Futures, C: FloatArray, regression: Regression
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
        horizon=how.window.horizon_steps(how, trajectories.steps, trajectories.dt),
        plant=trajectories.plant,
        beyond=how.lift.beyond,
    )
