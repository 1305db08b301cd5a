"""ż = (K_0 + Σ_i u_i K_i) z with inputs held for a sample (docs/equations.md 4)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from koopcli.koopman.predictor import responses
from koopcli.koopman.predictor.dynamics.shared import Rolled
from koopcli.koopman.predictor.modes import ComplexArray
from koopcli.records import Array, BoolArray, Channels, FloatArray, Packed


@dataclass(frozen=True, eq=False, repr=False)
class Generator(Rolled):
    """K_0 and the K_i of (4.9), ``K`` (1 + n_u, N, N) in 1/s, and the sampling period ``dt`` in s."""

    K: FloatArray
    dt: float

    kind: ClassVar[str] = "generator"
    about: ClassVar[str] = "bilinear by a generator"

    def __len__(self) -> int:
        return int(self.K.shape[1])

    @cached_property
    def eigenvalues(self) -> ComplexArray:
        """Those of exp(dt K_0)."""
        return np.exp(self.dt * np.linalg.eigvals(self.K[0]).astype(complex))

    @property
    def acting(self) -> BoolArray:
        """Which inputs have a K_i."""
        return np.asarray(self.K[1:].any(axis=(1, 2)))

    @cached_property
    def advance(self) -> responses.Advance:
        """The function of z (n, N) and u (n, n_u) to z⁺."""
        return responses.generator_step(self.K, self.dt)

    def pack(self, inputs: Channels) -> Packed:
        """K_0 and every K_i."""
        units = ", ".join(["1/s", *(f"1/(s {unit})" for unit in inputs.units)])
        K = Array(self.K, ("constant_and_input", "lifted_next", "lifted"), units)
        return Packed({"K": K}, {"kind": self.kind, "dt": self.dt})

    @classmethod
    def unpack(cls, packed: Packed) -> Generator:
        """The inverse of :meth:`pack`."""
        return cls(packed.arrays["K"].values[...], packed.meta["dt"])
