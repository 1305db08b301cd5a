"""The Gram matrix of tensor polynomials from moments, at a fraction of what its entries cost (docs/equations.md 3, 4).

A product of two polynomials of one state is a sum of few polynomials up to twice the degree (3.5), so that Σ ψ_i ψ_j
over all samples, for all i and j, is linear in the few sums of products of those (4.10).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from koopcli.koopman.bases.orthonormal import OrthonormalPolynomials
from koopcli.records import FloatArray


@dataclass(frozen=True)
class Products:
    """ψ_i ψ_j of a tensor basis by polynomials q_0, …, q_2k of each state, its ``factors``.

    ``linear``: for each state (k + 1, k + 1, 2k + 1), the part of each q_m in p_a p_d.
    """

    factors: tuple[OrthonormalPolynomials, ...]
    linear: tuple[FloatArray, ...]

    @property
    def moments(self) -> int:
        """How many moments there are."""
        return int(np.prod([c.shape[2] for c in self.linear]))

    def sums(self, x: FloatArray, weights: FloatArray) -> FloatArray:
        """Σ_n weights[q, n] q_a(x_n1) q_b(x_n2) … as (q, leading moments, last ones), for ``x`` (n, n_x)."""
        *leading, last = [axis(x[:, i]) for i, axis in enumerate(self.factors)]
        head = np.ones((1, len(x)))
        for factor in leading:
            head = (head[:, np.newaxis] * factor).reshape(-1, len(x))
        return np.stack([head @ (w * last).T for w in weights])

    def gram(self, sums: FloatArray) -> FloatArray:
        """Σ_n weights[q, n] ψ(x_n) ψ(x_n)ᵀ as (q, N, N), from such ``sums``."""
        q, n_x = len(sums), len(self.linear)
        gram = sums.reshape(q, *(c.shape[2] for c in self.linear))
        for c in self.linear:  # contracts one state's moments after another; (a, d) of each goes to the end
            gram = np.tensordot(gram, c, axes=(1, 2))
        order = [0, *range(1, 2 * n_x, 2), *range(2, 2 * n_x + 1, 2)]
        N = int(np.prod([len(c) for c in self.linear]))
        return np.asarray(gram.transpose(order)).reshape(q, N, N)


def products_of(axes: Sequence[OrthonormalPolynomials]) -> Products:
    """The products of a tensor basis with the factors ``axes``."""
    factors, linear = [], []
    for axis in axes:
        wide = _continued(axis)
        s, weights = _gauss(wide)
        t = axis.centre + axis.scale * s
        p, q = axis(t), wide(t)
        factors.append(wide)
        linear.append(np.einsum("n,an,dn,mn->adm", weights, p, p, q, optimize=True))
    return Products(tuple(factors), tuple(linear))


def _continued(axis: OrthonormalPolynomials) -> OrthonormalPolynomials:
    """The same polynomials and as many more, by the recurrence that those on any interval come to in the end.

    Close to orthonormal on the data, they add up to products with little cancellation; Legendre polynomials do not
    where samples crowd.
    """
    more = np.zeros(axis.degree)
    return OrthonormalPolynomials(
        axis.centre, axis.scale, np.concatenate([axis.alpha, more]), np.concatenate([axis.beta, more + 0.5])
    )


def _gauss(axis: OrthonormalPolynomials) -> tuple[FloatArray, FloatArray]:
    """Nodes in [-1, 1] and weights that integrate products of any two of the polynomials exactly: the eigenvalues of
    their recurrence, and the squares of the first entries of its eigenvectors.
    """
    off = axis.beta[1:]
    jacobi = np.diag(np.append(axis.alpha, 0.0)) + np.diag(off, 1) + np.diag(off, -1)
    nodes, vectors = np.linalg.eigh(jacobi)
    return nodes, np.asarray(vectors[0] ** 2)
