"""The linear predictor in lifted states, whichever method made it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.koopman.bases import BASES, Basis
from koopcli.records import Array, Channels, FloatArray, Meta, Packed

SEGMENT = 128  # steps whose responses are formed together


@dataclass(frozen=True)
class Predictor:
    """z⁺ = A z + B u, x̂ = C z with z = ψ(x): eqs. (4.1), (4.2) of docs/equations.md.

    ``A`` (N, N), ``B`` (N, n_u), ``C`` (n_x, N); ``dt`` in s; ``domain`` (2, n_x) the smallest and largest training
    state; ``plant`` what was identified, as JSON; ``rank`` and ``condition`` of the regression.
    """

    basis: Basis
    A: FloatArray
    B: FloatArray
    C: FloatArray
    dt: float
    domain: FloatArray
    state_channels: Channels
    input_channels: Channels
    rank: int
    condition: float
    spectral_radius: float
    plant: Meta = field(default_factory=dict)

    @property
    def functions(self) -> int:
        """Dimension N of the lifted state."""
        return len(self.A)

    def lift(self, x: FloatArray) -> FloatArray:
        """The lifted state z (..., N) of ``x`` (..., n_x)."""
        x = np.asarray(x, dtype=float)
        flat = x.reshape(math.prod(x.shape[:-1]), x.shape[-1])
        return self.basis.lift(flat).reshape(*x.shape[:-1], self.functions)

    def predict(self, x0: FloatArray, u: FloatArray | None = None, steps: int | None = None) -> FloatArray:
        """The predicted states (..., steps+1, n_x), lifted once at ``x0`` (..., n_x).

        ``u`` (..., steps, n_u) acts from sample k to k+1; without it the input is zero for ``steps`` steps.
        Raises ``InvalidValueError`` for shapes that do not fit.
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
        x = response(self, self.lift(x0).reshape(n, self.functions), u.reshape(n, k, n_u))
        return x.reshape(*x0.shape[:-1], k + 1, n_x)

    def step(self, x: FloatArray, u: FloatArray) -> FloatArray:
        """One step from the states ``x`` (n, n_x) lifted afresh, under ``u`` (n, n_u)."""
        return self.basis.lift(x) @ (self.C @ self.A).T + u @ (self.C @ self.B).T

    def pack(self) -> Packed:
        """The predictor for storage."""
        basis = self.basis.pack()
        state = self.state_channels.unit_text
        arrays = {
            "A": Array(self.A, ("lifted", "lifted"), "1"),
            "B": Array(self.B, ("lifted", "input"), "1/N"),
            "C": Array(self.C, ("state", "lifted"), state),
            "domain": Array(self.domain, ("lower and upper", "state"), state),
            **{f"basis/{name}": array for name, array in basis.arrays.items()},
        }
        meta = {
            "dt": self.dt,
            "rank": self.rank,
            "condition": self.condition if np.isfinite(self.condition) else None,
            "spectral_radius": self.spectral_radius,
            "plant": self.plant,
            "basis": basis.meta,
            "state_channels": self.state_channels.pack(),
            "input_channels": self.input_channels.pack(),
        }
        return Packed(arrays, meta)

    @classmethod
    def unpack(cls, packed: Packed) -> Predictor:
        """The inverse of :meth:`pack`."""
        meta, arrays = packed.meta, packed.arrays
        parts = {name.removeprefix("basis/"): a for name, a in arrays.items() if name.startswith("basis/")}
        return cls(
            basis=BASES[meta["basis"]["basis"]].unpack(Packed(parts, meta["basis"])),
            A=arrays["A"].values[...],
            B=arrays["B"].values[...],
            C=arrays["C"].values[...],
            dt=meta["dt"],
            domain=arrays["domain"].values[...],
            state_channels=Channels.unpack(meta["state_channels"]),
            input_channels=Channels.unpack(meta["input_channels"]),
            rank=meta["rank"],
            condition=np.inf if meta["condition"] is None else meta["condition"],
            spectral_radius=meta["spectral_radius"],
            plant=meta["plant"],
        )


def response(predictor: Predictor, z0: FloatArray, u: FloatArray) -> FloatArray:
    """x̂_k = C A^k z_0 + Σ_i C A^(k-1-i) B u_i (4.3) as (n, steps+1, n_x), for ``z0`` (n, N), ``u`` (n, steps, n_u).

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
        x[:, start:stop] = (z0 @ observed.reshape(-1, N).T).reshape(n, stop - start, n_x)
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


def _toeplitz(markov: FloatArray, delay: int, inputs: int, samples: int) -> FloatArray:
    """What input i of a segment adds to sample j + 1 of one ``delay`` steps later, (inputs · n_u, samples · n_x)."""
    lag = delay + np.arange(samples) - np.arange(inputs)[:, np.newaxis]
    block = np.where((lag >= 0)[..., np.newaxis, np.newaxis], markov[np.maximum(lag, 0)], 0.0)
    return block.transpose(0, 3, 1, 2).reshape(inputs * markov.shape[2], samples * markov.shape[1])
