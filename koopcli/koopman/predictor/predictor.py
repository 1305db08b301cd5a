"""The linear predictor in lifted states, whichever method made it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from koopcli.content import Content
from koopcli.errors import InvalidValueError
from koopcli.koopman.predictor.coverage import Coverage
from koopcli.koopman.predictor.dynamics import DYNAMICS, Dynamics
from koopcli.koopman.predictor.dynamics.diagonal import Diagonal
from koopcli.koopman.predictor.history import History, augmented, past_of
from koopcli.koopman.predictor.lifts import Observables
from koopcli.koopman.predictor.memory import Memory
from koopcli.koopman.predictor.regression import Regression
from koopcli.koopman.predictor.trust import Trust
from koopcli.progress import Progress, silent
from koopcli.records import OF_STATES, Array, Channels, FloatArray, Meta, Packed

UnpackLift = Callable[[Packed, Dynamics], Observables]  # of what is stored of a lift, and the dynamics that go with it
EXTRAPOLATES = "continue the functions fitted inside"


@dataclass(frozen=True, eq=False, repr=False)
class Predictor(Content):
    """x̂ = C z with z = ψ(x) and its dynamics, such as z⁺ = A z + B u: eqs. (4.1), (4.2) of docs/equations.md."""

    observables: Observables
    """The lift ψ."""
    dynamics: Dynamics
    """How the lifted state moves on."""
    C: FloatArray
    """(n_x, N)."""
    dt: float
    """Sampling period in s."""
    coverage: Coverage
    """Where the training states lie."""
    state_channels: Channels
    """Names and units of x."""
    input_channels: Channels
    """Names and units of u."""
    regression: Regression
    """What the regression behind it found."""
    horizon: int | None = None
    """The most steps that it may be asked for, None for any number."""
    plant: Meta = field(default_factory=dict)
    """What was identified, as JSON."""
    beyond: str = EXTRAPOLATES
    """What it does outside the hull of its data."""
    trust: Trust | None = None
    """An estimate of its errors."""
    limits: FloatArray | None = None
    """(2, n_u), the smallest and largest of each input in the data; a prediction takes none beyond them."""

    def __repr__(self) -> str:
        """Its spectral radius is told where it is known already, or costs nothing."""
        known = "spectral_radius" in vars(self.dynamics) or isinstance(self.dynamics, Diagonal)
        radius = f", spectral radius {self.spectral_radius:.6f}" if known else ""
        ahead = "" if self.horizon is None else f", {self.horizon} at most"
        back = f", {self.memory} past ones in its lift" if self.memory else ""
        channels = f"\n  states {self.state_channels}\n  inputs {self.input_channels}"
        return (
            f"Predictor: {self.dynamics.about}, {self.functions} functions ({type(self.observables).__name__}), "
            f"steps of {self.dt:g} s{back}{ahead}{radius}{channels}"
        )

    @property
    def functions(self) -> int:
        """Dimension N of the lifted state."""
        return len(self.dynamics)

    @property
    def spectral_radius(self) -> float:
        """The largest absolute value of the eigenvalues of what it predicts without input: above one it grows."""
        return self.dynamics.spectral_radius

    @property
    def knows_inputs(self) -> bool:
        """Whether inputs move the prediction at all."""
        return bool(self.dynamics.acting.any())

    @property
    def memory(self) -> int:
        """Steps of past states and inputs that its lift holds."""
        return self.observables.memory if isinstance(self.observables, Memory) else 0

    @property
    def needs_history(self) -> bool:
        """Whether a prediction starts from more than its first state."""
        return self.memory > 0

    def limited(self, u: FloatArray) -> FloatArray:
        """Inputs ``u`` (..., n_u) within their range in the data, where the predictor keeps to it."""
        return u if self.limits is None else np.clip(u, *self.limits)

    def limited_share(self, u: FloatArray) -> float:
        """The share of the samples ``u`` (..., n_u), from 0 to 1, in which an input is beyond its range in the data."""
        u = np.asarray(u, dtype=float)
        return float((self.limited(u) != u).any(axis=-1).mean()) if u.size else 0.0

    def lift(self, x: FloatArray) -> FloatArray:
        """The lifted state z (..., N) of ``x`` (..., n_x).

        With a memory ``x`` may be the augmented state of a :class:`~koopcli.koopman.predictor.memory.Memory`; a state
        alone is taken to have stood so, without inputs.
        """
        x = np.asarray(x, dtype=float)
        rows, lift = x.reshape(math.prod(x.shape[:-1]), x.shape[-1]), self.observables
        if isinstance(lift, Memory) and rows.shape[1] == len(self.state_channels):
            rows = augmented(lift, rows, np.zeros((len(rows), len(self.input_channels))))
        return lift.lift(rows).reshape(*x.shape[:-1], self.functions)

    def predict(
        self,
        x0: FloatArray,
        u: FloatArray | None = None,
        steps: int | None = None,
        progress: Progress = silent,
        history: History | None = None,
    ) -> FloatArray:
        """The predicted states (..., steps+1, n_x), lifted once at ``x0`` (..., n_x).

        ``u`` (..., steps, n_u) acts from sample k to k+1; without it the input is zero for ``steps`` steps. With
        ``limits`` every input, past ones too, is limited to them. ``history``: past states (..., p, n_x) and past
        inputs (..., p, n_u) of the p steps before ``x0`` or more, newest first, for a predictor with a memory; without
        it x0 and the first input are repeated, as if it had stood so. One without a memory makes no use of it.
        Raises ``InvalidValueError`` for shapes that do not fit and for more steps than the horizon.
        """
        x0 = np.asarray(x0, dtype=float)
        if u is None:
            if steps is None or steps < 0 or x0.ndim < 1:
                raise InvalidValueError("predict needs states x0 and the inputs u or a number of steps")
            u = np.zeros((*x0.shape[:-1], steps, len(self.input_channels)))
        u = np.asarray(u, dtype=float)
        n_x, n_u = len(self.state_channels), len(self.input_channels)
        fits = x0.ndim >= 1 and u.ndim == x0.ndim + 1 and u.shape[:-2] == x0.shape[:-1]
        if not fits or (x0.shape[-1], u.shape[-1]) != (n_x, n_u) or steps not in (None, u.shape[-2]):
            raise InvalidValueError(
                f"x0 {x0.shape} and u {u.shape} do not fit a predictor of {n_x} states and {n_u} inputs"
            )
        shape, k = x0.shape[:-1], u.shape[-2]
        n = math.prod(shape)
        check_horizon(k, self.horizon)
        x0, u = x0.reshape(n, n_x), self.limited(u.reshape(n, k, n_u))
        lift = self.observables
        if isinstance(lift, Memory):
            past = None
            if history is not None:
                past_x, past_u = past_of(history, shape, lift.memory, n_x, n_u)
                past = (past_x, self.limited(past_u))
            x0 = augmented(lift, x0, u[:, 0] if k else self.limited(np.zeros((n, n_u))), past)
        x = self.dynamics.predict(lift, self.C, x0, u, progress)
        return x.reshape(*shape, k + 1, n_x)

    def bound(self, x: FloatArray) -> FloatArray | None:
        """What the error in percent of a prediction from ``x`` (n, n_x) stays below nine times in ten, (n,), where the
        fit has estimated it.
        """
        return None if self.trust is None else self.trust.bound(x)

    def step(self, x: FloatArray, u: FloatArray) -> FloatArray:
        """One step from the states ``x`` (n, n_x) lifted afresh, under ``u`` (n, n_u).

        With a memory from augmented states to augmented states. Raises ``InvalidValueError`` for states alone there.
        """
        u = self.limited(u)
        if not isinstance(self.observables, Memory):
            return self._step(x, u)
        if x.shape[1] != self.observables.width:
            raise InvalidValueError(
                f"a step with a memory of {self.memory} steps goes from augmented states [x, past x, past u] of "
                f"{self.observables.width} numbers, not of {x.shape[1]}: give those, or use predict with a history"
            )
        return self.observables.onward(x, u, self._step(x, u))

    @cached_property
    def _step(self) -> Callable[[FloatArray, FloatArray], FloatArray]:
        return self.dynamics.stepper(self.observables, self.C)

    def pack(self) -> Packed:
        """The predictor for storage."""
        observables, state = self.observables.pack(), self.state_channels.unit_text
        coverage = self.coverage.pack(state)
        dynamics = self.dynamics.pack(self.input_channels)
        arrays = {
            **dynamics.arrays,
            "C": Array(self.C, ("state", "lifted"), state),
            **{f"coverage/{name}": array for name, array in coverage.arrays.items()},
            **{f"lift/{name}": _in_units(state, array) for name, array in observables.arrays.items()},
        }
        if self.limits is not None:
            arrays["limits"] = Array(self.limits, ("lower_and_upper", "input"), self.input_channels.unit_text)
        trust = None if self.trust is None else self.trust.pack(state)
        if trust is not None:
            arrays |= {f"trust/{name}": array for name, array in trust.arrays.items()}
        meta = {
            "dt": self.dt,
            "dynamics": {**dynamics.meta, "spectral_radius": self.spectral_radius},
            "regression": self.regression.pack(),
            "horizon": self.horizon,
            "plant": self.plant,
            "beyond": self.beyond,
            "trust": None if trust is None else trust.meta,
            "lift": observables.meta,
            "state_channels": self.state_channels.pack(),
            "input_channels": self.input_channels.pack(),
        }
        return Packed(arrays, meta)

    @classmethod
    def unpack(cls, packed: Packed, lifts: Mapping[str, UnpackLift]) -> Predictor:
        """The inverse of :meth:`pack`; ``lifts`` reads a lift of each kind (:mod:`koopcli.koopman.stored`)."""
        meta, arrays = packed.meta, packed.arrays
        dynamics = DYNAMICS[meta["dynamics"]["kind"]](Packed(arrays, meta["dynamics"]))
        vars(dynamics)["spectral_radius"] = meta["dynamics"]["spectral_radius"]  # it costs as much as a small fit
        return cls(
            observables=lifts[meta["lift"]["kind"]](Packed(packed.below("lift/"), meta["lift"]), dynamics),
            dynamics=dynamics,
            C=arrays["C"].values[...],
            dt=meta["dt"],
            coverage=Coverage.unpack(Packed(packed.below("coverage/"))),
            state_channels=Channels.unpack(meta["state_channels"]),
            input_channels=Channels.unpack(meta["input_channels"]),
            regression=Regression.unpack(meta["regression"]),
            horizon=meta["horizon"],
            plant=meta["plant"],
            beyond=meta["beyond"],
            trust=None if meta["trust"] is None else Trust.unpack(Packed(packed.below("trust/"), meta["trust"])),
            limits=arrays["limits"].values[...] if "limits" in arrays else None,
        )


def _in_units(state: str, array: Array) -> Array:
    """What is in units of states, with those."""
    return replace(array, units=state) if array.units == OF_STATES else array


def check_horizon(steps: int, horizon: int | None) -> None:
    """Raise ``InvalidValueError`` for more ``steps`` than a predictor's ``horizon``."""
    if horizon is not None and steps > horizon:
        raise InvalidValueError(
            f"{steps} steps are past the window that was fitted: this predictor may be asked for {horizon} at most; "
            "ask for fewer, or fit longer trajectories (simulate.steps) or a shorter table (fit-eigen.tabulate)"
        )
