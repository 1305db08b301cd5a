"""Polynomials of one variable that are orthonormal on given nodes (discrete Stieltjes, docs/equations.md 3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from koopcli.content import Content
from koopcli.errors import InvalidValueError
from koopcli.records import Array, FloatArray


@dataclass(frozen=True, eq=False, repr=False)
class OrthonormalPolynomials(Content):
    """Polynomials p_0 = 1, …, p_k with Σ_i w_i p_a(t_i) p_b(t_i) = [a = b] for weights that sum to one.

    ``s = (t - centre) / scale`` maps the nodes to [-1, 1]; the recurrence (3.1) is
    ``beta[j+1] p_{j+1} = (s - alpha[j]) p_j - beta[j] p_{j-1}``, with ``alpha`` (k,) and ``beta`` (k+1,).
    """

    centre: float
    scale: float
    alpha: FloatArray
    beta: FloatArray

    @property
    def degree(self) -> int:
        """The highest degree."""
        return len(self.alpha)

    @property
    def linear(self) -> tuple[float, float]:
        """(a, b) with t = a + b p_1(t)."""
        return self.centre + self.scale * float(self.alpha[0]), self.scale * float(self.beta[1])

    def pack(self) -> dict[str, Array]:
        """The recurrence coefficients."""
        return {
            "alpha": Array(self.alpha, ("recurrence",), "1"),
            "beta": Array(self.beta, ("degree",), "1"),
        }

    def __call__(self, t: FloatArray) -> FloatArray:
        """Values (degree + 1, *t.shape), the degree first so that each polynomial is contiguous."""
        s = (t - self.centre) / self.scale
        p = np.empty((self.degree + 1, *s.shape))
        p[0] = 1.0
        for j in range(self.degree):
            np.multiply(s - self.alpha[j], p[j], out=p[j + 1])
            if j > 0:
                p[j + 1] -= self.beta[j] * p[j - 1]
            p[j + 1] /= self.beta[j + 1]
        return p


@dataclass(frozen=True)
class Monomials:
    """1, t, t², …: what orthonormal polynomials are measured against; a regression on them loses its digits."""

    degree: int

    centre, scale = 0.0, 1.0
    linear = (0.0, 1.0)

    def pack(self) -> dict[str, Array]:
        """Nothing: the degrees of a basis say all."""
        return {}

    def __call__(self, t: FloatArray) -> FloatArray:
        """Values (degree + 1, *t.shape)."""
        p = np.ones((self.degree + 1, *t.shape))
        for j in range(self.degree):
            np.multiply(t, p[j], out=p[j + 1])
        return p


def orthonormal_polynomials(nodes: FloatArray, weights: FloatArray, degree: int) -> OrthonormalPolynomials:
    """The polynomials up to ``degree`` that are orthonormal on distinct ``nodes`` (n,) with ``weights`` (n,).

    Each new vector is orthogonalised twice against all before it, which keeps the recurrence exact to rounding
    up to the highest degree n - 1. Raises ``InvalidValueError`` when the nodes are too few for the degree.
    """
    if len(nodes) <= degree:
        raise InvalidValueError(
            f"{len(nodes)} distinct values of a state carry polynomials up to order {len(nodes) - 1}, "
            f"order {degree} was asked for: lower the order or sample more values"
        )
    centre = 0.5 * (nodes.max() + nodes.min())
    scale = 0.5 * (nodes.max() - nodes.min()) or 1.0
    s = (nodes - centre) / scale
    root_weights = np.sqrt(weights / weights.sum())
    Q = np.empty((len(nodes), degree + 1))
    Q[:, 0] = root_weights
    alpha, beta = np.zeros(degree), np.ones(degree + 1)
    for j in range(degree):
        v = s * Q[:, j]
        for _ in range(2):
            overlap = Q[:, : j + 1].T @ v
            v -= Q[:, : j + 1] @ overlap
            alpha[j] += overlap[j]
        beta[j + 1] = np.linalg.norm(v)
        Q[:, j + 1] = v / beta[j + 1]
    return OrthonormalPolynomials(float(centre), float(scale), alpha, beta)
