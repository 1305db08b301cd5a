"""z⁺ = A z with A given by its rates (docs/equations.md 7)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from koopcli.koopman.predictor import responses
from koopcli.koopman.predictor.dynamics.shared import Spectral
from koopcli.koopman.predictor.lifts import Observables
from koopcli.koopman.predictor.modes import ComplexArray, Modes
from koopcli.progress import Progress
from koopcli.records import Array, BoolArray, Channels, FloatArray, Packed


@dataclass(frozen=True, eq=False, repr=False)
class Diagonal(Spectral):
    """``modes`` of (7.2), which none of the ``inputs`` moves; how many there are is all that is known of them."""

    modes: Modes
    inputs: int

    kind: ClassVar[str] = "diagonal"
    about: ClassVar[str] = "linear by rates"

    def __len__(self) -> int:
        return len(self.modes)

    @property
    def eigenvalues(self) -> ComplexArray:
        """Those of one block."""
        return self.modes.eigenvalues

    @property
    def acting(self) -> BoolArray:
        """None."""
        return np.zeros(self.inputs, dtype=bool)

    def predict(
        self, lift: Observables, C: FloatArray, x0: FloatArray, u: FloatArray, progress: Progress
    ) -> FloatArray:
        """C A^k ψ(x_0), whatever the inputs are."""
        return responses.linear(lift, self.modes, np.zeros((len(self), 0)), C, x0, u[..., :0])

    def stepper(self, lift: Observables, C: FloatArray) -> Callable[[FloatArray, FloatArray], FloatArray]:
        """C A ψ(x)."""
        onward = lift.onto(C @ self.modes)
        return lambda x, _: onward(x)

    def pack(self, inputs: Channels) -> Packed:
        """The continuous rates and couplings of the repeated block, beside the discrete block itself."""
        modes = self.modes
        arrays = {
            "rates": Array(np.column_stack([modes.rates.real, modes.rates.imag]), ("mode", "part"), "1/s"),
            "couplings": Array(modes.couplings, ("coupling",), "1/s"),
            "A/block": Array(modes.block, ("state_of_block_next", "state_of_block"), "1"),
        }
        return Packed(arrays, {"kind": self.kind, "copies": modes.copies, "dt": modes.dt, "inputs": self.inputs})

    @classmethod
    def unpack(cls, packed: Packed) -> Diagonal:
        """The inverse of :meth:`pack`."""
        rates, couplings = (packed.arrays[name].values[...] for name in ("rates", "couplings"))
        meta = packed.meta
        modes = Modes(rates[:, 0] + 1j * rates[:, 1], couplings, meta["copies"], meta["dt"])
        return cls(modes, meta["inputs"])
