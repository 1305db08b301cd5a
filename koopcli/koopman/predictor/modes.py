"""A linear system by its rates instead of its matrix (docs/equations.md 7)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from koopcli.content import Content
from koopcli.records import FloatArray

ComplexArray = npt.NDArray[np.complex128]


@dataclass(frozen=True, eq=False, repr=False)
class Modes(Content):
    """A that repeats one small block ``copies`` times, the block given by its continuous rates (7.2).

    ``rates`` (L,) in 1/s, a complex one followed by its conjugate; ``couplings`` (L-1,) in 1/s: how each state drives
    the next one. Without couplings every state is an eigenfunction; with them the block spans the same exponentials in
    Newton's form, in which nearly equal rates cost no digits. ``dt`` in s. The lifted state (copies · L,) runs through
    a block fastest.
    """

    rates: ComplexArray
    couplings: FloatArray
    copies: int
    dt: float

    __array_ufunc__ = None  # numpy leaves `rows @ modes` to __rmatmul__

    def __len__(self) -> int:
        return self.copies * len(self.rates)

    @property
    def eigenvalues(self) -> ComplexArray:
        """Eigenvalues e^{λ dt} of one block of the discrete A."""
        return np.exp(self.rates * self.dt)

    @cached_property
    def generator(self) -> FloatArray:
        """The block of the continuous system, ż = K z, (L, L) in 1/s: real form of the rates, couplings below."""
        K = np.diag(self.rates.real) + np.diag(self.couplings, -1)
        for first in np.flatnonzero(self.rates.imag > 0):
            frequency = self.rates[first].imag
            K[first, first + 1], K[first + 1, first] = -frequency, frequency
        return np.asarray(K)

    @cached_property
    def block(self) -> FloatArray:
        """The block of the discrete A, e^{K dt}, (L, L)."""
        from scipy.linalg import expm  # noqa: PLC0415  (what only reads a predictor goes without)

        return np.asarray(expm(self.generator * self.dt))

    def __matmul__(self, z: FloatArray) -> FloatArray:
        """A times ``z`` (N,) or (N, m)."""
        blocks = z.reshape(self.copies, len(self.rates), -1)
        return np.asarray(self.block @ blocks).reshape(z.shape)

    def __rmatmul__(self, rows: FloatArray) -> FloatArray:
        """``rows`` (..., N) times A."""
        blocks = rows.reshape(*rows.shape[:-1], self.copies, len(self.rates))
        return np.asarray(blocks @ self.block).reshape(rows.shape)

    def after(self, steps: int) -> Modes:
        """A^``steps``, by the same rates."""
        return replace(self, dt=steps * self.dt)

    def powers(self, steps: int) -> FloatArray:
        """The block after 0 .. ``steps`` steps, (steps + 1, L, L)."""
        powers = np.empty((steps + 1, *self.block.shape))
        powers[0] = np.eye(len(self.block))
        for k in range(steps):
            powers[k + 1] = self.block @ powers[k]
        return powers


def newton_couplings(rates: ComplexArray, seconds: float) -> FloatArray:
    """Couplings (L-1,) that keep the states of a block of one size over a window of ``seconds`` (7.2).

    The two states of a complex pair are coupled by their frequency alone.
    """
    couplings = np.arange(1.0, len(rates)) / seconds
    couplings[rates.imag[:-1] > 0] = 0.0
    return couplings


def exponentials(rates: ComplexArray, t: FloatArray) -> FloatArray:
    """e^{λt} in real form (len(t), L): e^{at} of a real rate, e^{at} cos ωt and e^{at} sin ωt of a pair (7.1)."""
    growth = np.exp(rates * t[:, np.newaxis])
    return np.where(rates.imag >= 0, growth.real, -growth.imag)
