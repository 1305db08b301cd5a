"""The states alone as observables."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np

from koopcli.koopman.bases.basis import BasisChoice
from koopcli.koopman.predictor.lifts import Observed
from koopcli.records import FloatArray, Packed


@dataclass(frozen=True)
class States:
    """ψ(x) = x: EDMD with it is dynamic mode decomposition, with inputs where there are any."""

    functions: int

    stored: ClassVar[str] = "states"
    constant: ClassVar[None] = None
    products: ClassVar[None] = None

    @property
    def state_map(self) -> FloatArray:
        """The identity."""
        return np.eye(self.functions)

    def lift(self, x: FloatArray) -> FloatArray:
        """The states themselves."""
        return np.asarray(x, dtype=float)

    def lift_rows(self, x: FloatArray, out: FloatArray) -> None:
        """ψ(x) of the states (n, n_x) as rows into ``out`` (N, n)."""
        out[:] = self.lift(x).T

    def observe(self, x: FloatArray, rows: FloatArray) -> FloatArray:
        """rows · x as (n, R), for ``rows`` (R, n_x)."""
        return x @ rows.T

    def onto(self, rows: FloatArray) -> Observed:
        """The function of ``x`` (n, n_x) that observes ``rows`` (R, n_x)."""
        return partial(self.observe, rows=rows)

    def group_moments(self, x: FloatArray, weights: FloatArray) -> FloatArray:
        """Σ_j weights[j] x[s, j] as (n, q, n_x), for states in groups (n, m, n_x) and weights (m, q)."""
        return np.asarray(weights.T @ x)

    def pack(self) -> Packed:
        """Nothing but the number of states."""
        return Packed({}, {"kind": self.stored, "functions": self.functions})

    @classmethod
    def unpack(cls, packed: Packed) -> States:
        """The inverse of :meth:`pack`."""
        return cls(packed.meta["functions"])


@dataclass(frozen=True)
class StatesAlone(BasisChoice):
    """The states alone, which is dynamic mode decomposition."""

    kind: ClassVar[str] = "states"
    makes = States
    name = "DMD"

    def make(self, x: FloatArray, *, raw: bool = False) -> States:
        """The basis on the training states ``x`` (n, n_x)."""
        return States(x.shape[1])

    def functions(self, states: int) -> int:
        """As many as there are ``states``."""
        return states
