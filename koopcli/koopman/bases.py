"""Bases of observables ψ(x). A new basis is one frozen class and one line in ``BASES``."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import ClassVar, Protocol

import numpy as np

from koopcli.koopman.lifts import Lift, Observed
from koopcli.koopman.orthonormal import OrthonormalPolynomials, orthonormal_polynomials
from koopcli.records import Array, FloatArray, Packed


class Basis(Lift, Protocol):
    """A lift by explicit functions of the state, which EDMD can fit."""

    @property
    def constant(self) -> int | None:
        """Index of the observable that is one everywhere, if there is one."""

    @property
    def state_map(self) -> FloatArray:
        """C (n_x, N) with x = C ψ(x) exactly: every basis holds the states themselves."""

    def group_moments(self, x: FloatArray, weights: FloatArray) -> FloatArray:
        """Σ_j weights[j] ψ(x[s, j]) as (n, q, N), for states in groups (n, m, n_x) and weights (m, q)."""


@dataclass(frozen=True)
class TensorPolynomial:
    """All products p_a(x_1) p_b(x_2) … with each degree at most k: (k + 1)^n_x functions (docs/equations.md 3).

    The factors are orthonormal on the training data, which spans what the monomials span: EDMD does not depend on
    the choice, its condition number does. The last state's degree runs fastest; the first function is 1.
    """

    axes: tuple[OrthonormalPolynomials, ...]

    @property
    def constant(self) -> int:
        """The product of the constants comes first."""
        return 0

    @property
    def functions(self) -> int:
        """Number of observables."""
        return int(np.prod([axis.degree + 1 for axis in self.axes]))

    @property
    def state_map(self) -> FloatArray:
        """C (n_x, N) with x = C ψ(x): each state is a combination of its own p_0 and p_1."""
        sizes = [axis.degree + 1 for axis in self.axes]
        C = np.zeros((len(sizes), self.functions))
        for i, axis in enumerate(self.axes):
            C[i, 0] = axis.centre + axis.scale * axis.alpha[0]
            C[i, int(np.prod(sizes[i + 1 :]))] = axis.scale * axis.beta[1]
        return C

    def lift(self, x: FloatArray) -> FloatArray:
        """ψ(x) (n, N) of the states (n, n_x)."""
        z = np.ones((len(x), 1))
        for i, axis in enumerate(self.axes):
            z = (z[:, :, np.newaxis] * axis(x[:, i]).T[:, np.newaxis, :]).reshape(
                len(x), z.shape[1] * (axis.degree + 1)
            )
        return z

    def observe(self, x: FloatArray, rows: FloatArray) -> FloatArray:
        """rows · ψ(x) as (n, R), for ``rows`` (R, N)."""
        return self.lift(x) @ rows.T

    def onto(self, rows: FloatArray) -> Observed:
        """The function of ``x`` (n, n_x) that observes ``rows`` (R, N)."""
        return partial(self.observe, rows=rows)

    def group_moments(self, x: FloatArray, weights: FloatArray) -> FloatArray:
        """Σ_j weights[j] ψ(x[s, j]) as (n, q, N), for states in groups (n, m, n_x) and weights (m, q).

        The sum over j is one small matrix product for each group, between the leading factors and the weighted last
        one, so ψ itself is never formed.
        """
        n, m, _ = x.shape
        *leading, last = [axis(x[..., i]) for i, axis in enumerate(self.axes)]  # (degree + 1, n, m) each
        head = np.ones((1, n, m))
        for factor in leading:
            head = (head[:, np.newaxis] * factor).reshape(-1, n, m)
        tail = (weights.T[:, np.newaxis, np.newaxis, :] * last).reshape(-1, n, m)  # (q · last, n, m)
        product = np.matmul(head.transpose(1, 0, 2), tail.transpose(1, 2, 0))  # (n, head, q · last)
        q = weights.shape[1]
        moments: FloatArray = product.reshape(n, len(head), q, len(last)).transpose(0, 2, 1, 3).reshape(n, q, -1)
        return moments

    def pack(self) -> Packed:
        """The recurrence coefficients of each factor."""
        arrays: dict[str, Array] = {}
        for i, axis in enumerate(self.axes):
            arrays[f"{i}/map"] = Array(np.array([axis.centre, axis.scale]), ("centre and scale",), "that of the state")
            arrays[f"{i}/alpha"] = Array(axis.alpha, ("degree",), "1")
            arrays[f"{i}/beta"] = Array(axis.beta, ("degree",), "1")
        return Packed(arrays, {"kind": "tensor", "axes": len(self.axes)})

    @classmethod
    def unpack(cls, packed: Packed) -> TensorPolynomial:
        """The inverse of :meth:`pack`."""
        values = {name: array.values[...] for name, array in packed.arrays.items()}
        axes = []
        for i in range(packed.meta["axes"]):
            centre, scale = values[f"{i}/map"].tolist()
            axes.append(OrthonormalPolynomials(centre, scale, values[f"{i}/alpha"], values[f"{i}/beta"]))
        return cls(tuple(axes))


def tensor_polynomial(nodes: Sequence[tuple[FloatArray, FloatArray]], order: int) -> TensorPolynomial:
    """The tensor basis of ``order`` on (nodes, weights) for each state."""
    return TensorPolynomial(tuple(orthonormal_polynomials(t, w, order) for t, w in nodes))


@dataclass(frozen=True)
class States:
    """ψ(x) = x: EDMD with it is dynamic mode decomposition, with inputs where there are any."""

    functions: int

    constant: ClassVar[None] = None

    @property
    def state_map(self) -> FloatArray:
        """The identity."""
        return np.eye(self.functions)

    def lift(self, x: FloatArray) -> FloatArray:
        """The states themselves."""
        return np.asarray(x, dtype=float)

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
class BasisKind:
    """How a basis is made from the data's marginals and an order, counted beforehand, and restored."""

    make: Callable[[Sequence[tuple[FloatArray, FloatArray]], int], Basis]
    count: Callable[[int, int], int]
    unpack: Callable[[Packed], Basis]


BASES: dict[str, BasisKind] = {
    "tensor": BasisKind(
        make=tensor_polynomial,
        count=lambda order, states: (order + 1) ** states,
        unpack=TensorPolynomial.unpack,
    ),
    "states": BasisKind(
        make=lambda nodes, order: States(len(nodes)),
        count=lambda order, states: states,
        unpack=States.unpack,
    ),
}
