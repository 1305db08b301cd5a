"""Polynomial observables: products of one polynomial for each state, which products being a matter of the family."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import product
from math import comb
from typing import ClassVar, Protocol

import numpy as np

from koopcli.choices import setting
from koopcli.content import Content
from koopcli.koopman.bases.basis import BasisChoice
from koopcli.koopman.bases.moments import Products, products_of
from koopcli.koopman.bases.orthonormal import Monomials, OrthonormalPolynomials, orthonormal_polynomials
from koopcli.koopman.predictor.lifts import Observed
from koopcli.records import OF_STATES, Array, BoolArray, FloatArray, IndexArray, Packed


class Axis(Protocol):
    """Polynomials p_0 = 1, p_1, … of one state."""

    @property
    def centre(self) -> float:
        """The t that is mapped to zero."""

    @property
    def scale(self) -> float:
        """How far from there the t is that is mapped to one."""

    @property
    def degree(self) -> int:
        """The highest degree."""

    @property
    def linear(self) -> tuple[float, float]:
        """(a, b) with t = a + b p_1(t)."""

    def __call__(self, t: FloatArray) -> FloatArray:
        """Values (degree + 1, *t.shape)."""

    def pack(self) -> dict[str, Array]:
        """The polynomials as arrays, none of monomials."""


@dataclass(frozen=True, eq=False, repr=False)
class Polynomial(Content):
    """Products p_a(x_1) p_b(x_2) … with the degrees of each in a row of ``degrees`` (N, n_x) (docs/equations.md 3).

    The rows are downward closed, so that the span does not depend on where a state has its origin; the first is zero,
    the function 1. With factors that are orthonormal on the training data EDMD is well conditioned; with monomials it
    is the same in exact arithmetic.
    """

    axes: tuple[Axis, ...]
    degrees: IndexArray

    stored: ClassVar[str] = "polynomial"

    @property
    def constant(self) -> int:
        """The product of the constants comes first."""
        return 0

    @property
    def functions(self) -> int:
        """Number of observables."""
        return len(self.degrees)

    @property
    def state_map(self) -> FloatArray:
        """C (n_x, N) with x = C ψ(x): each state is a combination of its own p_0 and p_1."""
        C = np.zeros((len(self.axes), self.functions))
        for i, axis in enumerate(self.axes):
            C[i, 0], slope = axis.linear
            alone = np.flatnonzero((self.degrees == np.eye(len(self.axes), dtype=int)[i]).all(axis=1))
            C[i, alone[0]] = slope
        return C

    def lift(self, x: FloatArray) -> FloatArray:
        """ψ(x) (n, N) of the states (n, n_x)."""
        z = np.empty((self.functions, len(x)))
        self.lift_rows(x, z)
        return z.T

    def lift_rows(self, x: FloatArray, out: FloatArray) -> None:
        """ψ(x) of the states (n, n_x) as rows into ``out`` (N, n), which is contiguous."""
        *leading, last = [axis(x[:, i]) for i, axis in enumerate(self.axes)]  # (degree + 1, n) each
        degrees, choice = self._leading
        head = _heads(leading, degrees, last[0])
        if choice is None:
            np.multiply(head[:, np.newaxis], last, out=out.reshape(len(head), len(last), len(x)))
        else:
            np.multiply(head[choice // len(last)], last[self.degrees[:, -1]], out=out)

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
        degrees, choice = self._leading
        head = _heads(leading, degrees, last[0])
        tail = (weights.T[:, np.newaxis, np.newaxis, :] * last).reshape(-1, n, m)  # (q · last, n, m)
        both = np.matmul(head.transpose(1, 0, 2), tail.transpose(1, 2, 0))  # (n, head, q · last)
        q = weights.shape[1]
        moments = both.reshape(n, len(head), q, len(last)).transpose(0, 2, 1, 3).reshape(n, q, -1)
        return np.asarray(moments if choice is None else moments[:, :, choice])

    @cached_property
    def products(self) -> Products | None:
        """Products of two observables, where the family is all products of orthonormal factors."""
        factors = [axis for axis in self.axes if isinstance(axis, OrthonormalPolynomials)]
        heads = np.prod([axis.degree + 1 for axis in self.axes[:-1]])
        degrees, choice = self._leading
        every = choice is None and len(degrees) == heads
        return products_of(factors) if every and len(factors) == len(self.axes) else None

    @cached_property
    def _leading(self) -> tuple[IndexArray, IndexArray | None]:
        """The distinct degrees of all states but the last, and where each function is among their products with the
        last one's polynomials; None where it is all of them in order.
        """
        head, which = np.unique(self.degrees[:, :-1], axis=0, return_inverse=True)
        choice = which.ravel() * (self.axes[-1].degree + 1) + self.degrees[:, -1]
        every = len(head) * (self.axes[-1].degree + 1)
        return head, None if np.array_equal(choice, np.arange(every)) else choice

    def pack(self) -> Packed:
        """The degrees, how each state is mapped to [-1, 1], and the recurrence coefficients of its polynomials."""
        arrays = {
            "degrees": Array(self.degrees, ("function", "state"), "1"),
            "centre": Array(np.array([axis.centre for axis in self.axes]), ("state",), OF_STATES),
            "scale": Array(np.array([axis.scale for axis in self.axes]), ("state",), OF_STATES),
        }
        for i, axis in enumerate(self.axes):
            arrays |= {f"{i}/{name}": array for name, array in axis.pack().items()}
        return Packed(arrays, {"kind": self.stored})

    @classmethod
    def unpack(cls, packed: Packed) -> Polynomial:
        """The inverse of :meth:`pack`."""
        values = {name: array.values[...] for name, array in packed.arrays.items()}
        degrees = values["degrees"]
        axes: list[Axis] = []
        for i, degree in enumerate(degrees.max(axis=0)):
            if f"{i}/alpha" in values:
                centre, scale = values["centre"][i].item(), values["scale"][i].item()
                axes.append(OrthonormalPolynomials(centre, scale, values[f"{i}/alpha"], values[f"{i}/beta"]))
            else:
                axes.append(Monomials(int(degree)))
        return cls(tuple(axes), degrees)


def _heads(leading: Sequence[FloatArray], degrees: IndexArray, ones: FloatArray) -> FloatArray:
    """Products (rows, …) of the factors (degree + 1, …) of all states but the last, for each row of ``degrees``."""
    if not leading:
        return ones[np.newaxis]
    head = leading[0][degrees[:, 0]]
    for i, factor in enumerate(leading[1:], 1):
        head *= factor[degrees[:, i]]
    return head


@dataclass(frozen=True)
class Polynomials(BasisChoice):
    """Products of one polynomial for each state; the kinds differ in which products."""

    makes = Polynomial
    sized_by = "order"

    def belongs(self, degrees: IndexArray) -> BoolArray:
        """Which products belong to the basis, (rows,), by their ``degrees`` (rows, n_x)."""
        raise NotImplementedError

    def make(self, x: FloatArray, *, raw: bool = False) -> Polynomial:
        """The basis on the states ``x`` (n, n_x): factors orthonormal on their marginals, or ``raw`` monomials."""
        highest = self.degrees(x.shape[1])
        axes: Sequence[Axis]
        if raw:
            axes = [Monomials(degree) for degree in highest]
        else:
            axes = [orthonormal_polynomials(*_marginal(x[:, i]), degree) for i, degree in enumerate(highest)]
        rows = np.array(list(product(*(range(degree + 1) for degree in highest))))
        return Polynomial(tuple(axes), rows[self.belongs(rows)])


@dataclass(frozen=True)
class Tensor(Polynomials):
    """Polynomials up to the order in each state."""

    kind: ClassVar[str] = "tensor"
    order: int = setting(7, low=1, high=1000, option=True, help="highest degree of each state")

    @property
    def name(self) -> str:
        """What an EDMD predictor with it is called."""
        return f"EDMD, order {self.order}"

    def degrees(self, states: int) -> tuple[int, ...]:
        """The order, of each state."""
        return (self.order,) * states

    def belongs(self, degrees: IndexArray) -> BoolArray:
        """All of them."""
        return np.full(len(degrees), True)

    def functions(self, states: int) -> int:
        """Number of observables of so many ``states``."""
        return int((self.order + 1) ** states)


@dataclass(frozen=True)
class Total(Polynomials):
    """Polynomials up to the order in total."""

    kind: ClassVar[str] = "total"
    order: int = setting(7, low=1, high=1000, option=True, help="highest degree of a product")

    @property
    def name(self) -> str:
        """What an EDMD predictor with it is called."""
        return f"EDMD, total degree {self.order}"

    def degrees(self, states: int) -> tuple[int, ...]:
        """The order, of each state."""
        return (self.order,) * states

    def belongs(self, degrees: IndexArray) -> BoolArray:
        """Those whose degrees add up to the order at most."""
        return np.asarray(degrees.sum(axis=1) <= self.order)

    def functions(self, states: int) -> int:
        """Number of observables of so many ``states``."""
        return comb(self.order + states, states)


@dataclass(frozen=True)
class Anisotropic(Polynomials):
    """Polynomials up to the order in the yaw rate and to another degree in the velocity."""

    kind: ClassVar[str] = "anisotropic"
    order: int = setting(7, low=1, high=1000, option=True, help="highest degree of the yaw rate")
    degree_velocity: int = setting(1, low=0, high=1000, option=True, help="highest degree of v_x and v_y together")

    @property
    def name(self) -> str:
        """What an EDMD predictor with it is called."""
        return f"EDMD, degrees {self.degree_velocity} and {self.order}"

    def degrees(self, states: int) -> tuple[int, ...]:
        """That of the velocity, and the order of the last state."""
        return (self.degree_velocity,) * (states - 1) + (self.order,)

    def belongs(self, degrees: IndexArray) -> BoolArray:
        """Those whose degrees of all states but the last do not add up to more."""
        return np.asarray(degrees[:, :-1].sum(axis=1) <= self.degree_velocity)

    def functions(self, states: int) -> int:
        """Number of observables of so many ``states``."""
        return comb(self.degree_velocity + states - 1, states - 1) * (self.order + 1)


def _marginal(values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The distinct ones of ``values`` (n,) with their shares."""
    distinct, counts = np.unique(values, return_counts=True)
    return distinct, counts / counts.sum()
