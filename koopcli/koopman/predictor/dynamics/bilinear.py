"""z⁺ = A z + B u + Σ_i u_i N_i z (docs/equations.md 4)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from koopcli.koopman.predictor import responses
from koopcli.koopman.predictor.dynamics.shared import Rolled, of_inputs
from koopcli.koopman.predictor.modes import ComplexArray
from koopcli.records import Array, BoolArray, Channels, FloatArray, Packed


@dataclass(frozen=True, eq=False, repr=False)
class Bilinear(Rolled):
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

    @property
    def acting(self) -> BoolArray:
        """Which inputs have a column in B or an N_i."""
        return np.asarray(self.B.any(axis=0) | self.N.any(axis=(1, 2)))

    @cached_property
    def advance(self) -> responses.Advance:
        """The function of z (n, N) and u (n, n_u) to z⁺."""
        return responses.bilinear_step(self.A, self.B, self.N)

    def pack(self, inputs: Channels) -> Packed:
        """A, B and every N_i."""
        units = ", ".join(f"1/({unit})" for unit in inputs.units)
        arrays = {
            "A": Array(self.A, ("lifted_next", "lifted"), "1"),
            "B": of_inputs(self.B, inputs),
            "N": Array(self.N, ("input", "lifted_next", "lifted"), units),
        }
        return Packed(arrays, {"kind": self.kind})

    @classmethod
    def unpack(cls, packed: Packed) -> Bilinear:
        """The inverse of :meth:`pack`."""
        return cls(*(packed.arrays[name].values[...] for name in ("A", "B", "N")))
