"""The Gram matrix of tensor polynomials from moments, at a fraction of what its entries cost (docs/equations.md 3, 4).

A product of two polynomials of one state is a sum of Legendre polynomials up to twice the degree (3.5), so that
Σ ψ_i ψ_j over all samples, for all i and j, is linear in the few sums of products of those (4.10).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from koopcli.koopman.orthonormal import OrthonormalPolynomials
from koopcli.records import FloatArray


@dataclass(frozen=True)
class Products:
    """ψ_i ψ_j of a tensor basis by ``legendre`` polynomials, one set for each state.

    ``linear``: for each state (k + 1, k + 1, 2k + 1), the part of each Legendre polynomial in p_a p_d.
    """

    legendre: tuple[OrthonormalPolynomials, ...]
    linear: tuple[FloatArray, ...]

    @property
    def moments(self) -> int:
        """How many moments there are."""
        return int(np.prod([c.shape[2] for c in self.linear]))

    def sums(self, x: FloatArray, weights: FloatArray) -> FloatArray:
        """Σ_n weights[q, n] L_a(x_n1) L_b(x_n2) … as (q, leading moments, last ones), for ``x`` (n, n_x)."""
        *leading, last = [axis(x[:, i]) for i, axis in enumerate(self.legendre)]
        head = np.ones((1, len(x)))
        for factor in leading:
            head = (head[:, np.newaxis] * factor).reshape(-1, len(x))
        return np.stack([head @ (w * last).T for w in weights])

    def gram(self, sums: FloatArray) -> FloatArray:
        """Σ_n weights[q, n] ψ(x_n) ψ(x_n)ᵀ as (q, N, N), from such ``sums``."""
        q, n_x = len(sums), len(self.linear)
        found = sums.reshape(q, *(c.shape[2] for c in self.linear))
        for c in self.linear:  # contracts one state's moments after another; (a, d) of each goes to the end
            found = np.tensordot(found, c, axes=(1, 2))
        order = [0, *range(1, 2 * n_x, 2), *range(2, 2 * n_x + 1, 2)]
        N = int(np.prod([len(c) for c in self.linear]))
        return np.asarray(found.transpose(order)).reshape(q, N, N)


def products_of(axes: Sequence[OrthonormalPolynomials]) -> Products:
    """The products of a tensor basis with the factors ``axes``."""
    legendre, linear = [], []
    for axis in axes:
        wide = _legendre(axis, 2 * axis.degree)
        nodes, weights = np.polynomial.legendre.leggauss(2 * axis.degree + 1)  # exact for all that is integrated
        t = axis.centre + axis.scale * nodes
        p, tall = axis(t), wide(t)
        legendre.append(wide)
        linear.append(np.einsum("n,an,dn,mn->adm", weights / 2, p, p, tall, optimize=True))
    return Products(tuple(legendre), tuple(linear))


def _legendre(axis: OrthonormalPolynomials, degree: int) -> OrthonormalPolynomials:
    """Legendre polynomials on the interval of ``axis``, with mean square one there."""
    j = np.arange(1.0, degree + 1)
    beta = np.concatenate([[1.0], j / np.sqrt(4 * j**2 - 1)])
    return OrthonormalPolynomials(axis.centre, axis.scale, np.zeros(degree), beta)
