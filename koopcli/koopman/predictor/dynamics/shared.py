"""What several kinds of dynamics have in common."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from functools import cached_property

import numpy as np

from koopcli.content import Content
from koopcli.koopman.predictor import responses
from koopcli.koopman.predictor.lifts import Observables
from koopcli.koopman.predictor.modes import ComplexArray
from koopcli.progress import Progress
from koopcli.records import Array, Channels, FloatArray


class Spectral(Content):
    """Dynamics with eigenvalues."""

    @property
    @abstractmethod
    def eigenvalues(self) -> ComplexArray:
        """Those of one step without input."""

    @cached_property
    def spectral_radius(self) -> float:
        """The largest absolute value of the eigenvalues."""
        return float(np.abs(self.eigenvalues).max())


class Rolled(Spectral):
    """Dynamics in which what acts on z changes with the input, so that z itself is rolled."""

    @property
    @abstractmethod
    def advance(self) -> responses.Advance:
        """The function of z (n, N) and u (n, n_u) to z⁺."""

    def predict(
        self, lift: Observables, C: FloatArray, x0: FloatArray, u: FloatArray, progress: Progress
    ) -> FloatArray:
        """C z_k with z rolled from ψ(x_0)."""
        return responses.rolled(lift, self.advance, C, x0, u, progress)

    def stepper(self, lift: Observables, C: FloatArray) -> Callable[[FloatArray, FloatArray], FloatArray]:
        """C times the next z."""
        return lambda x, u: np.asarray(self.advance(lift.lift(x), u) @ C.T)


def of_inputs(B: FloatArray, inputs: Channels) -> Array:
    """B with the units of its columns."""
    return Array(B, ("lifted_next", "input"), ", ".join(f"1/({unit})" for unit in inputs.units))
