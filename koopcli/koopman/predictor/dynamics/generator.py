"""ż = (K_0 + Σ_i u_i K_i) z with inputs held for a sample (docs/equations.md 4)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from koopcli.content import Content
from koopcli.koopman.predictor import responses
from koopcli.koopman.predictor.lifts import Lift
from koopcli.koopman.predictor.modes import ComplexArray
from koopcli.progress import Progress
from koopcli.records import Array, BoolArray, Channels, FloatArray, Packed


@dataclass(frozen=True, eq=False, repr=False)
class Generator(Content):
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

    @cached_property
    def spectral_radius(self) -> float:
        """The largest absolute value of the eigenvalues."""
        return float(np.abs(self.eigenvalues).max())

    @property
    def acting(self) -> BoolArray:
        """Which inputs have a K_i."""
        return np.asarray(self.K[1:].any(axis=(1, 2)))

    @cached_property
    def advance(self) -> responses.Advance:
        """The function of z (n, N) and u (n, n_u) to z⁺."""
        return responses.generator_step(self.K, self.dt)

    def predict(self, lift: Lift, C: FloatArray, x0: FloatArray, u: FloatArray, progress: Progress) -> FloatArray:
        """What acts on z changes with the input, so z itself is rolled."""
        return responses.rolled(lift, self.advance, C, x0, u, progress)

    def stepper(self, lift: Lift, C: FloatArray) -> Callable[[FloatArray, FloatArray], FloatArray]:
        """C times the next z."""
        return lambda x, u: np.asarray(self.advance(lift.lift(x), u) @ C.T)

    def pack(self, inputs: Channels) -> Packed:
        """K_0 and every K_i."""
        units = ", ".join(["1/s", *(f"1/(s {unit})" for unit in inputs.units)])
        K = Array(self.K, ("none and each input", "lifted", "lifted"), units)
        return Packed({"K": K}, {"kind": self.kind, "dt": self.dt})

    @classmethod
    def unpack(cls, packed: Packed) -> Generator:
        """The inverse of :meth:`pack`."""
        return cls(packed.arrays["K"].values[...], packed.meta["dt"])
