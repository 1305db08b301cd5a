"""How a lifted state moves on: a kind of dynamics is a frozen class in a file of its own and a name in ``DYNAMICS``."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar, Protocol

from koopcli.koopman.predictor.dynamics.bilinear import Bilinear
from koopcli.koopman.predictor.dynamics.diagonal import Diagonal
from koopcli.koopman.predictor.dynamics.force_driven import ForceDriven
from koopcli.koopman.predictor.dynamics.generator import Generator
from koopcli.koopman.predictor.dynamics.linear import Linear
from koopcli.koopman.predictor.lifts import Observables
from koopcli.koopman.predictor.modes import ComplexArray
from koopcli.progress import Progress
from koopcli.records import BoolArray, Channels, FloatArray, Packed


class Dynamics(Protocol):
    """What a predictor asks of its dynamics; N is the dimension of the lifted state."""

    kind: ClassVar[str]
    about: ClassVar[str]
    """What it is in a word or two."""

    def __len__(self) -> int: ...

    @property
    def eigenvalues(self) -> ComplexArray:
        """Those of one step without input, one for each copy of a block (L,)."""

    @property
    def spectral_radius(self) -> float:
        """The largest absolute value of the eigenvalues."""

    @property
    def acting(self) -> BoolArray:
        """Which inputs (n_u,) move the lifted state at all."""

    def predict(
        self, lift: Observables, C: FloatArray, x0: FloatArray, u: FloatArray, progress: Progress
    ) -> FloatArray:
        """x̂_k = C z_k (n, steps+1, n_x) from ``x0`` (n, n_x), lifted once, under ``u`` (n, steps, n_u)."""

    def stepper(self, lift: Observables, C: FloatArray) -> Callable[[FloatArray, FloatArray], FloatArray]:
        """The function of states (n, n_x), lifted afresh, and inputs (n, n_u) to the next states (n, n_x)."""

    def pack(self, inputs: Channels) -> Packed:
        """Its operators, with the units of the ``inputs``, and its kind."""


DYNAMICS: dict[str, Callable[[Packed], Dynamics]] = {
    kind.kind: kind.unpack for kind in (Linear, Diagonal, Bilinear, Generator, ForceDriven)
}
