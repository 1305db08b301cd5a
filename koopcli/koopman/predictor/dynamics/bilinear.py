"""z⁺ = A z + B u + Σ_i u_i N_i z (docs/equations.md 4)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from koopcli.content import Content
from koopcli.koopman.predictor import responses
from koopcli.koopman.predictor.dynamics.linear import packed_inputs
from koopcli.koopman.predictor.lifts import Lift
from koopcli.koopman.predictor.modes import ComplexArray
from koopcli.progress import Progress
from koopcli.records import Array, BoolArray, Channels, FloatArray, Packed


@dataclass(frozen=True, eq=False, repr=False)
class Bilinear(Content):
    """``A`` (N, N), ``B`` (N, n_u) and the N_i ``N`` (n_u, N, N) of (4.6)."""

    A: FloatArray
    B: FloatArray
    N: FloatArray

    kind: ClassVar[str] = "bilinear"
    about: ClassVar[str] = "bilinear"

    def __len__(self) -> int:
        return len(self.A)

    @cached_property
    def eigenvalues(self) -> ComplexArray:
        """Those of A."""
        return np.linalg.eigvals(self.A).astype(complex)

    @cached_property
    def spectral_radius(self) -> float:
        """The largest absolute value of A's eigenvalues."""
        return float(np.abs(self.eigenvalues).max())

    @property
    def acting(self) -> BoolArray:
        """Which inputs have a column in B or an N_i."""
        return np.asarray(self.B.any(axis=0) | self.N.any(axis=(1, 2)))

    @cached_property
    def advance(self) -> responses.Advance:
        """The function of z (n, N) and u (n, n_u) to z⁺."""
        return responses.bilinear_step(self.A, self.B, self.N)

    def predict(self, lift: Lift, C: FloatArray, x0: FloatArray, u: FloatArray, progress: Progress) -> FloatArray:
        """What acts on z changes with the input, so z itself is rolled."""
        return responses.rolled(lift, self.advance, C, x0, u, progress)

    def stepper(self, lift: Lift, C: FloatArray) -> Callable[[FloatArray, FloatArray], FloatArray]:
        """C times the next z."""
        return lambda x, u: np.asarray(self.advance(lift.lift(x), u) @ C.T)

    def pack(self, inputs: Channels) -> Packed:
        """A, B and every N_i."""
        units = ", ".join(f"1/({unit})" for unit in inputs.units)
        arrays = {
            "A": Array(self.A, ("lifted", "lifted"), "1"),
            "B": packed_inputs(self.B, inputs),
            "N": Array(self.N, ("input", "lifted", "lifted"), units),
        }
        return Packed(arrays, {"kind": self.kind})

    @classmethod
    def unpack(cls, packed: Packed) -> Bilinear:
        """The inverse of :meth:`pack`."""
        return cls(*(packed.arrays[name].values[...] for name in ("A", "B", "N")))
