"""z⁺ = A z + B u (docs/equations.md 4)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from koopcli.koopman.predictor import responses
from koopcli.koopman.predictor.dynamics.shared import Spectral, of_inputs
from koopcli.koopman.predictor.lifts import Observables
from koopcli.koopman.predictor.modes import ComplexArray
from koopcli.progress import Progress
from koopcli.records import Array, BoolArray, Channels, FloatArray, Packed


@dataclass(frozen=True, eq=False, repr=False)
class Linear(Spectral):
    """``A`` (N, N) and ``B`` (N, n_u) of (4.1)."""

    A: FloatArray
    B: FloatArray

    kind: ClassVar[str] = "linear"
    about: ClassVar[str] = "linear"

    def __len__(self) -> int:
        return len(self.A)

    @cached_property
    def eigenvalues(self) -> ComplexArray:
        """Those of A."""
        return np.linalg.eigvals(self.A).astype(complex)

    @property
    def acting(self) -> BoolArray:
        """Which inputs have a column in B."""
        return np.asarray(self.B.any(axis=0))

    def predict(
        self, lift: Observables, C: FloatArray, x0: FloatArray, u: FloatArray, progress: Progress
    ) -> FloatArray:
        """Eq. (4.3)."""
        return responses.linear(lift, self.A, self.B, C, x0, u)

    def stepper(self, lift: Observables, C: FloatArray) -> Callable[[FloatArray, FloatArray], FloatArray]:
        """C A ψ(x) + C B u."""
        onward, driven = lift.onto(C @ self.A), (C @ self.B).T
        return lambda x, u: onward(x) + u @ driven

    def pack(self, inputs: Channels) -> Packed:
        """A and B."""
        return Packed(
            {"A": Array(self.A, ("lifted_next", "lifted"), "1"), "B": of_inputs(self.B, inputs)}, {"kind": self.kind}
        )

    @classmethod
    def unpack(cls, packed: Packed) -> Linear:
        """The inverse of :meth:`pack`."""
        return cls(packed.arrays["A"].values[...], packed.arrays["B"].values[...])
