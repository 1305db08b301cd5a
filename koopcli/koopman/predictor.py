"""The linear predictor in lifted states, whichever method made it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.koopman.bases import STORED
from koopcli.koopman.coverage import Coverage
from koopcli.koopman.lifts import Lift, Observed
from koopcli.koopman.modes import Modes
from koopcli.koopman.tabulated import Nearest
from koopcli.records import Array, Channels, FloatArray, Meta, Packed

SEGMENT = 128  # steps whose responses are formed together
ROLLED = 1024  # trajectories whose lifted states are rolled together
TABLES: dict[str, type[Nearest]] = {Nearest.kind: Nearest}  # lifts that look eigenfunctions up


@dataclass(frozen=True)
class Predictor:
    """z⁺ = A z + B u, x̂ = C z with z = ψ(x): eqs. (4.1), (4.2) of docs/equations.md; a bilinear one adds Σ_i u_i N_i z.

    ``A`` (N, N) as a matrix or by its rates, ``B`` (N, n_u), ``C`` (n_x, N), ``N`` the N_i (n_u, N, N) or None; ``dt``
    in s; ``coverage``: where the training states lie; ``plant`` what was identified, as JSON; ``rank`` of
    ``directions`` and ``condition`` of the regression; ``horizon``: the steps that it may be asked for, None for any.
    """

    observables: Lift
    A: FloatArray | Modes
    B: FloatArray
    C: FloatArray
    dt: float
    coverage: Coverage
    state_channels: Channels
    input_channels: Channels
    rank: int
    directions: int
    condition: float
    spectral_radius: float
    horizon: int | None = None
    plant: Meta = field(default_factory=dict)
    N: FloatArray | None = None

    @property
    def functions(self) -> int:
        """Dimension N of the lifted state."""
        return len(self.A)

    @property
    def knows_inputs(self) -> bool:
        """Whether inputs move the prediction at all."""
        return bool(self.B.any() or (self.N is not None and self.N.any()))

    def lift(self, x: FloatArray) -> FloatArray:
        """The lifted state z (..., N) of ``x`` (..., n_x)."""
        x = np.asarray(x, dtype=float)
        flat = x.reshape(math.prod(x.shape[:-1]), x.shape[-1])
        return self.observables.lift(flat).reshape(*x.shape[:-1], self.functions)

    def predict(self, x0: FloatArray, u: FloatArray | None = None, steps: int | None = None) -> FloatArray:
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
        n, k = math.prod(x0.shape[:-1]), u.shape[-2]
        check_horizon(k, self.horizon)
        respond = response if self.N is None else bilinear_response
        x = respond(self, x0.reshape(n, n_x), u.reshape(n, k, n_u))
        return x.reshape(*x0.shape[:-1], k + 1, n_x)

    def step(self, x: FloatArray, u: FloatArray) -> FloatArray:
        """One step from the states ``x`` (n, n_x) lifted afresh, under ``u`` (n, n_u)."""
        n_x = len(self.C)
        onward = self._onward(x)
        after = onward[:, :n_x] + u @ (self.C @ self.B).T
        if self.N is not None:
            after = after + np.einsum("ni,nij->nj", u, onward[:, n_x:].reshape(*u.shape, n_x))
        return np.asarray(after)

    @cached_property
    def _onward(self) -> Observed:
        """C A ψ(x), and behind it C N_i ψ(x) for every input of a bilinear predictor."""
        rows = self.C @ self.A
        if self.N is not None:
            rows = np.concatenate([rows, *(self.C @ self.N)])
        return self.observables.onto(rows)

    def pack(self) -> Packed:
        """The predictor for storage."""
        observables, state = self.observables.pack(), self.state_channels.unit_text
        coverage = self.coverage.pack(state)
        arrays = {
            **_pack_operator(self.A),
            "B": Array(self.B, ("lifted", "input"), ", ".join(f"1/({unit})" for unit in self.input_channels.units)),
            "C": Array(self.C, ("state", "lifted"), state),
            **_pack_bilinear(self.N, self.input_channels),
            **{f"coverage/{name}": array for name, array in coverage.arrays.items()},
            **{f"lift/{name}": array for name, array in observables.arrays.items()},
        }
        meta = {
            "dt": self.dt,
            "copies": self.A.copies if isinstance(self.A, Modes) else None,
            "rank": self.rank,
            "directions": self.directions,
            "condition": self.condition if np.isfinite(self.condition) else None,
            "spectral_radius": self.spectral_radius,
            "horizon": self.horizon,
            "plant": self.plant,
            "lift": observables.meta,
            "state_channels": self.state_channels.pack(),
            "input_channels": self.input_channels.pack(),
        }
        return Packed(arrays, meta)

    @classmethod
    def unpack(cls, packed: Packed) -> Predictor:
        """The inverse of :meth:`pack`."""
        meta, arrays = packed.meta, packed.arrays
        A: FloatArray | Modes
        if meta["copies"] is None:
            A = arrays["A"].values[...]
        else:
            rates = arrays["rates"].values[...]
            couplings = arrays["couplings"].values[...]
            A = Modes(rates[:, 0] + 1j * rates[:, 1], couplings, meta["copies"], meta["dt"])
        return cls(
            observables=_unpack_lift(Packed(_below("lift/", arrays), meta["lift"]), A),
            A=A,
            B=arrays["B"].values[...],
            C=arrays["C"].values[...],
            N=arrays["N"].values[...] if "N" in arrays else None,
            dt=meta["dt"],
            coverage=Coverage.unpack(Packed(_below("coverage/", arrays))),
            state_channels=Channels.unpack(meta["state_channels"]),
            input_channels=Channels.unpack(meta["input_channels"]),
            rank=meta["rank"],
            directions=meta["directions"],
            condition=np.inf if meta["condition"] is None else meta["condition"],
            spectral_radius=meta["spectral_radius"],
            horizon=meta["horizon"],
            plant=meta["plant"],
        )


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


def _pack_bilinear(N: FloatArray | None, inputs: Channels) -> dict[str, Array]:
    if N is None:
        return {}
    return {"N": Array(N, ("input", "lifted", "lifted"), ", ".join(f"1/({unit})" for unit in inputs.units))}


def _unpack_lift(packed: Packed, A: FloatArray | Modes) -> Lift:
    """A table, which its modes carry on, or a basis."""
    kind = packed.meta["kind"]
    return TABLES[kind].unpack(packed, A) if isinstance(A, Modes) else STORED[kind](packed)


def _below(prefix: str, arrays: Mapping[str, Array]) -> dict[str, Array]:
    return {name.removeprefix(prefix): array for name, array in arrays.items() if name.startswith(prefix)}


def response(predictor: Predictor, x0: FloatArray, u: FloatArray) -> FloatArray:
    """x̂_k = C A^k ψ(x_0) + Σ_i C A^(k-1-i) B u_i (4.3), (n, steps+1, n_x), for ``x0`` (n, n_x), ``u`` (n, steps, n_u).

    Only the n_x rows of C A^k are ever formed; the lifted state is not rolled. Time goes in segments, so that memory
    grows with the steps and not with their square.
    """
    n, steps, n_u = u.shape
    n_x, N = predictor.C.shape
    x = np.empty((n, steps + 1, n_x))
    markov = np.empty((steps, n_x, n_u))  # C A^k B
    rows = predictor.C  # C A^k
    for start in range(0, steps + 1, SEGMENT):
        stop = min(start + SEGMENT, steps + 1)
        observed = np.empty((stop - start, n_x, N))
        for k in range(stop - start):
            observed[k] = rows
            rows = rows @ predictor.A
        x[:, start:stop] = predictor.observables.observe(x0, observed.reshape(-1, N)).reshape(n, stop - start, n_x)
        markov[start : min(stop, steps)] = observed[: steps - start] @ predictor.B
    for first in range(0, steps, SEGMENT):  # the inputs of one segment ...
        inputs = u[:, first : first + SEGMENT]
        for later in range(first, steps, SEGMENT):  # ... act on its own samples and on those of every later one
            samples = min(SEGMENT, steps - later)
            acting = _toeplitz(markov, later - first, inputs.shape[1], samples)
            x[:, later + 1 : later + 1 + samples] += (inputs.reshape(n, inputs.shape[1] * n_u) @ acting).reshape(
                n, samples, n_x
            )
    return x


def bilinear_response(predictor: Predictor, x0: FloatArray, u: FloatArray) -> FloatArray:
    """x̂_k = C z_k with z⁺ = A z + B u + Σ_i u_i N_i z (4.6), (n, steps+1, n_x), for ``x0`` and ``u`` as above.

    The system that acts on z changes with the input, so z itself is rolled, for ``ROLLED`` trajectories together: one
    matrix product for a step and all its terms.
    """
    assert predictor.N is not None
    assert not isinstance(predictor.A, Modes)
    n, steps, n_u = u.shape
    functions = predictor.functions
    x = np.empty((n, steps + 1, len(predictor.C)))
    every = np.concatenate([predictor.A, *predictor.N]).T  # z -> [A z, N_1 z, …]
    for start in range(0, n, ROLLED):
        rows = slice(start, start + ROLLED)
        z = predictor.observables.lift(x0[rows])
        x[rows, 0] = z @ predictor.C.T
        for k in range(steps):
            terms = (z @ every).reshape(len(z), 1 + n_u, functions)
            acting = u[rows, k]
            z = terms[:, 0] + np.einsum("ni,nif->nf", acting, terms[:, 1:]) + acting @ predictor.B.T
            x[rows, k + 1] = z @ predictor.C.T
    return x


def _toeplitz(markov: FloatArray, delay: int, inputs: int, samples: int) -> FloatArray:
    """What input i of a segment adds to sample j + 1 of one ``delay`` steps later, (inputs · n_u, samples · n_x)."""
    lag = delay + np.arange(samples) - np.arange(inputs)[:, np.newaxis]
    block = np.where((lag >= 0)[..., np.newaxis, np.newaxis], markov[np.maximum(lag, 0)], 0.0)
    return block.transpose(0, 3, 1, 2).reshape(inputs * markov.shape[2], samples * markov.shape[1])
