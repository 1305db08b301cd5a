"""Bases of observables ψ(x) by name. A new basis is one frozen class in a file of its own and one line in ``BASES``."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import ClassVar, Protocol

import numpy as np

from koopcli.koopman.bases.moments import Products
from koopcli.koopman.bases.polynomial import FAMILIES, Polynomial, polynomial
from koopcli.koopman.bases.thin_plate import ThinPlate, thin_plate_basis
from koopcli.koopman.predictor.lifts import Lift, Observed
from koopcli.records import FloatArray, Packed


class Basis(Lift, Protocol):
    """A lift by explicit functions of the state, which EDMD can fit."""

    @property
    def constant(self) -> int | None:
        """Index of the observable that is one everywhere, if there is one."""

    @property
    def state_map(self) -> FloatArray:
        """C (n_x, N) with x = C ψ(x) exactly: every basis holds the states themselves."""

    def lift_rows(self, x: FloatArray, out: FloatArray) -> None:
        """ψ(x) of the states (n, n_x) as rows into ``out`` (N, n), which is contiguous."""

    @property
    def products(self) -> Products | None:
        """How the products of two observables are sums of fewer functions (3.5), where they are."""

    def group_moments(self, x: FloatArray, weights: FloatArray) -> FloatArray:
        """Σ_j weights[j] ψ(x[s, j]) as (n, q, N), for states in groups (n, m, n_x) and weights (m, q)."""


@dataclass(frozen=True)
class States:
    """ψ(x) = x: EDMD with it is dynamic mode decomposition, with inputs where there are any."""

    functions: int

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
        return Packed({}, {"kind": "states", "functions": self.functions})

    @classmethod
    def unpack(cls, packed: Packed) -> States:
        """The inverse of :meth:`pack`."""
        return cls(packed.meta["functions"])


@dataclass(frozen=True)
class Choice:
    """Which basis: ``kind`` of ``BASES`` with those of the other fields that it has a use for.

    Polynomials: ``order``, the highest degree of each state (tensor), of a product (total) or of the last state
    (anisotropic, where ``degree_velocity`` bounds the sum of the others'); ``raw`` monomials instead of orthonormal
    ones. Thin plates: number of ``centres``, their ``placement`` of ``PLACEMENTS`` and its ``seed``.
    """

    kind: str = "tensor"
    order: int = 1
    degree_velocity: int = 1
    raw: bool = False
    centres: int = 1
    placement: str = "k-means"
    seed: int = 0


@dataclass(frozen=True)
class BasisKind:
    """How a basis is made from training states ``x`` (n, n_x), and counted beforehand for a number of states.

    ``degrees``: of each state's polynomials, which ask for one distinct value more; empty for other bases.
    """

    make: Callable[[FloatArray, Choice], Basis]
    count: Callable[[Choice, int], int]
    degrees: Callable[[Choice, int], tuple[int, ...]] = lambda choice, states: ()


def _polynomials(family: str) -> BasisKind:
    found = FAMILIES[family]
    return BasisKind(
        make=lambda x, c: polynomial(x, family, c.order, c.degree_velocity, raw=c.raw),
        count=lambda c, states: found.count(c.order, c.degree_velocity, states),
        degrees=lambda c, states: found.highest(c.order, c.degree_velocity, states),
    )


BASES: dict[str, BasisKind] = {
    **{family: _polynomials(family) for family in FAMILIES},
    "thin-plate": BasisKind(
        make=lambda x, c: thin_plate_basis(x, c.centres, c.placement, c.seed),
        count=lambda c, states: 1 + states + c.centres,
    ),
    "states": BasisKind(make=lambda x, c: States(x.shape[1]), count=lambda c, states: states),
}

STORED: dict[str, Callable[[Packed], Basis]] = {
    "polynomial": Polynomial.unpack,
    "thin-plate": ThinPlate.unpack,
    "states": States.unpack,
}
