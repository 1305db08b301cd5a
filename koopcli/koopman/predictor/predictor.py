"""The linear predictor in lifted states, whichever method made it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from koopcli.content import Content
from koopcli.errors import InvalidValueError
from koopcli.koopman.predictor import responses
from koopcli.koopman.predictor.coverage import Coverage
from koopcli.koopman.predictor.lifts import Lift, Observed
from koopcli.koopman.predictor.modes import Modes
from koopcli.koopman.predictor.trust import Trust
from koopcli.progress import Progress, silent
from koopcli.records import Array, Channels, FloatArray, Meta, Packed

UnpackLift = Callable[[Packed, Any], Lift]  # of what is stored of a lift, and the A that goes with it
EXTRAPOLATES = "continue the functions fitted inside"


@dataclass(frozen=True, eq=False, repr=False)
class Predictor(Content):
    """z⁺ = A z + B u, x̂ = C z with z = ψ(x): eqs. (4.1), (4.2) of docs/equations.md. A bilinear one adds Σ_i u_i N_i z
    (4.6), or steps by its ``generator`` (4.9), of which A, B and N are then the value and the slope at u = 0.
    """

    observables: Lift
    """The lift ψ."""
    A: FloatArray | Modes
    """(N, N), as a matrix or by its rates."""
    B: FloatArray
    """(N, n_u)."""
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
    rank: int
    """How many directions the data determine."""
    directions: int
    """How many directions the regression has."""
    condition: float
    """Condition number of the regression."""
    horizon: int | None = None
    """The most steps that it may be asked for, None for any number."""
    plant: Meta = field(default_factory=dict)
    """What was identified, as JSON."""
    N: FloatArray | None = None
    """The N_i (n_u, N, N) of a bilinear one."""
    generator: FloatArray | None = None
    """(1 + n_u, N, N) in 1/s, of one in continuous time."""
    missed: float | None = None
    """The share of the data in percent that its exponentials do not represent."""
    beyond: str = EXTRAPOLATES
    """What it does outside the hull of its data."""
    trust: Trust | None = None
    """An estimate of its errors."""
    solved_by: str = ""
    """How the regression was solved, as :mod:`koopcli.koopman.edmd.blockwise` and ``product`` name it."""

    def __repr__(self) -> str:
        """Its spectral radius is told where it is known already, or costs nothing."""
        known = isinstance(self.A, Modes) or "spectral_radius" in vars(self)
        radius = f", spectral radius {self.spectral_radius:.6f}" if known else ""
        ahead = "" if self.horizon is None else f", {self.horizon} at most"
        return (
            f"Predictor: {self.dynamics}, {self.functions} functions ({type(self.observables).__name__}), "
            f"steps of {self.dt:g} s{ahead}{radius}\n  states {self.state_channels}\n  inputs {self.input_channels}"
        )

    @property
    def dynamics(self) -> str:
        """How its lifted state moves on, in a word or two."""
        if self.N is None:
            return "linear by rates" if isinstance(self.A, Modes) else "linear"
        return "bilinear" if self.generator is None else "bilinear by a generator"

    @property
    def functions(self) -> int:
        """Dimension N of the lifted state."""
        return len(self.A)

    @cached_property
    def spectral_radius(self) -> float:
        """The largest absolute value of A's eigenvalues: of what it predicts without input, above one grows."""
        eigenvalues = self.A.eigenvalues if isinstance(self.A, Modes) else np.linalg.eigvals(self.A)
        return float(np.abs(eigenvalues).max())

    @property
    def knows_inputs(self) -> bool:
        """Whether inputs move the prediction at all."""
        return bool(self.B.any() or (self.N is not None and self.N.any()))

    def lift(self, x: FloatArray) -> FloatArray:
        """The lifted state z (..., N) of ``x`` (..., n_x)."""
        x = np.asarray(x, dtype=float)
        flat = x.reshape(math.prod(x.shape[:-1]), x.shape[-1])
        return self.observables.lift(flat).reshape(*x.shape[:-1], self.functions)

    def predict(
        self,
        x0: FloatArray,
        u: FloatArray | None = None,
        steps: int | None = None,
        progress: Progress = silent,
    ) -> FloatArray:
        """The predicted states (..., steps+1, n_x), lifted once at ``x0`` (..., n_x).

        ``u`` (..., steps, n_u) acts from sample k to k+1; without it the input is zero for ``steps`` steps.
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
        x0, u = x0.reshape(n, n_x), u.reshape(n, k, n_u)
        if self._advance is None:
            x = responses.linear(self.observables, self.A, self.B, self.C, x0, u)
        else:
            x = responses.rolled(self.observables, self._advance, self.C, x0, u, progress)
        return x.reshape(*shape, k + 1, n_x)

    def bound(self, x: FloatArray) -> FloatArray | None:
        """What the error in percent of a prediction from ``x`` (n, n_x) stays below nine times in ten, (n,), where the
        fit has estimated it.
        """
        return None if self.trust is None else self.trust.bound(x)

    def step(self, x: FloatArray, u: FloatArray) -> FloatArray:
        """One step from the states ``x`` (n, n_x) lifted afresh, under ``u`` (n, n_u)."""
        if self._advance is None:
            return self._onward(x) + u @ (self.C @ self.B).T
        return np.asarray(self._advance(self.observables.lift(x), u) @ self.C.T)

    @cached_property
    def _onward(self) -> Observed:
        """C A ψ(x)."""
        return self.observables.onto(self.C @ self.A)

    @cached_property
    def _advance(self) -> responses.Advance | None:
        """How the lifted state of a bilinear predictor moves, which has no powers of one matrix."""
        if self.N is None:
            return None
        if self.generator is not None:
            return responses.generator_step(self.generator, self.dt)
        assert not isinstance(self.A, Modes)
        return responses.bilinear_step(self.A, self.B, self.N)

    def pack(self) -> Packed:
        """The predictor for storage."""
        observables, state = self.observables.pack(), self.state_channels.unit_text
        coverage = self.coverage.pack(state)
        arrays = {
            **_pack_operator(self.A),
            "B": Array(self.B, ("lifted", "input"), ", ".join(f"1/({unit})" for unit in self.input_channels.units)),
            "C": Array(self.C, ("state", "lifted"), state),
            **_pack_bilinear(self.N, self.generator, self.input_channels),
            **{f"coverage/{name}": array for name, array in coverage.arrays.items()},
            **{f"lift/{name}": array for name, array in observables.arrays.items()},
        }
        trust = None if self.trust is None else self.trust.pack(state)
        if trust is not None:
            arrays |= {f"trust/{name}": array for name, array in trust.arrays.items()}
        meta = {
            "dt": self.dt,
            "copies": self.A.copies if isinstance(self.A, Modes) else None,
            "rank": self.rank,
            "directions": self.directions,
            "condition": self.condition if np.isfinite(self.condition) else None,
            "spectral_radius": self.spectral_radius,
            **({"solved_by": self.solved_by} if self.solved_by else {}),
            "horizon": self.horizon,
            "plant": self.plant,
            "missed": self.missed,
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
        A: FloatArray | Modes
        if meta["copies"] is None:
            A = arrays["A"].values[...]
        else:
            rates = arrays["rates"].values[...]
            couplings = arrays["couplings"].values[...]
            A = Modes(rates[:, 0] + 1j * rates[:, 1], couplings, meta["copies"], meta["dt"])
        found = cls(
            observables=lifts[meta["lift"]["kind"]](Packed(packed.below("lift/"), meta["lift"]), A),
            A=A,
            B=arrays["B"].values[...],
            C=arrays["C"].values[...],
            N=arrays["N"].values[...] if "N" in arrays else None,
            generator=arrays["generator"].values[...] if "generator" in arrays else None,
            dt=meta["dt"],
            coverage=Coverage.unpack(Packed(packed.below("coverage/"))),
            state_channels=Channels.unpack(meta["state_channels"]),
            input_channels=Channels.unpack(meta["input_channels"]),
            rank=meta["rank"],
            directions=meta["directions"],
            condition=np.inf if meta["condition"] is None else meta["condition"],
            solved_by=meta.get("solved_by", ""),
            horizon=meta["horizon"],
            plant=meta["plant"],
            missed=meta["missed"],
            beyond=meta["beyond"],
            trust=None if meta["trust"] is None else Trust.unpack(Packed(packed.below("trust/"), meta["trust"])),
        )
        vars(found)["spectral_radius"] = meta["spectral_radius"]  # it costs as much as a small fit
        return found


def check_horizon(steps: int, horizon: int | None) -> None:
    """Raise ``InvalidValueError`` for more ``steps`` than a predictor's ``horizon``."""
    if horizon is not None and steps > horizon:
        raise InvalidValueError(
            f"{steps} steps are past the window that was fitted: this predictor may be asked for {horizon} at most; "
            "ask for fewer, or fit longer trajectories (simulate.steps) or a shorter table (fit-eigen.tabulate)"
        )


def _pack_operator(A: FloatArray | Modes) -> dict[str, Array]:
    """A as a matrix, or the continuous rates and couplings of its repeated block beside the discrete block itself."""
    if not isinstance(A, Modes):
        return {"A": Array(A, ("lifted", "lifted"), "1")}
    return {
        "rates": Array(np.column_stack([A.rates.real, A.rates.imag]), ("mode", "real and imaginary"), "1/s"),
        "couplings": Array(A.couplings, ("mode",), "1/s"),
        "A/block": Array(A.block, ("state of a block", "state of a block"), "1"),
    }


def _pack_bilinear(N: FloatArray | None, generator: FloatArray | None, inputs: Channels) -> dict[str, Array]:
    found = {}
    if N is not None:
        found["N"] = Array(N, ("input", "lifted", "lifted"), ", ".join(f"1/({unit})" for unit in inputs.units))
    if generator is not None:
        each = ["1/s", *(f"1/(s {unit})" for unit in inputs.units)]
        found["generator"] = Array(generator, ("none and each input", "lifted", "lifted"), ", ".join(each))
    return found
