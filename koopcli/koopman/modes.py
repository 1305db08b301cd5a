"""A linear system by its rates instead of its matrix (docs/equations.md 7)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from koopcli.records import FloatArray

ComplexArray = npt.NDArray[np.complex128]
IndexArray = npt.NDArray[np.intp]
Times = npt.NDArray[np.floating[Any]]


@dataclass(frozen=True)
class Modes:
    """A block diagonal A that repeats one block of modes ``copies`` times.

    ``rates`` (L,) in 1/s; a complex one is followed by its conjugate, and the two states of the pair are the real and
    the imaginary part of g e^{λt} (7.2). ``dt`` in s. The lifted state (copies · L,) runs through the rates fastest.
    """

    rates: ComplexArray
    copies: int
    dt: float

    __array_ufunc__ = None  # numpy leaves `rows @ modes` to __rmatmul__

    def __len__(self) -> int:
        return self.copies * len(self.rates)

    @property
    def eigenvalues(self) -> ComplexArray:
        """Eigenvalues e^{λ dt} of one block of the discrete A."""
        return np.exp(self.rates * self.dt)

    @property
    def leading(self) -> npt.NDArray[np.bool_]:
        """Which states of a block are real modes or the first of a pair, (L,)."""
        return np.asarray(self.rates.imag >= 0)

    @cached_property
    def _partner(self) -> IndexArray:
        """The other state of a pair, or the state itself, (L,)."""
        return np.arange(len(self.rates)) + np.sign(self.rates.imag).astype(np.intp)

    def __rmatmul__(self, rows: FloatArray) -> FloatArray:
        """``rows`` (..., N) times A."""
        blocks: FloatArray = rows.reshape(*rows.shape[:-1], self.copies, len(self.rates))
        same, other = self.eigenvalues.real, self.eigenvalues.imag
        return np.asarray(blocks * same + blocks[..., self._partner] * other).reshape(rows.shape)

    def evolve(self, blocks: FloatArray, t: Times) -> FloatArray:
        """The lifted states ``blocks`` (n, copies, L or 1) after the times ``t`` (n,) in s, as (n, copies, L).

        One column stands for the same g in every mode: the start (g, 0) of each pair.
        """
        growth = np.exp(self.rates * t[:, np.newaxis])[:, np.newaxis]  # (n, 1, L)
        if blocks.shape[-1] != len(self.rates):
            first = np.where(self.leading, growth.real, -growth.imag)  # sin of the pair's own frequency
            return np.asarray(blocks * first)
        return np.asarray(blocks * growth.real - blocks[..., self._partner] * growth.imag)


def exponentials(rates: ComplexArray, t: Times) -> FloatArray:
    """e^{λt} in real form (len(t), L): e^{at} of a real rate, e^{at} cos ωt and e^{at} sin ωt of a pair (7.2)."""
    growth = np.exp(rates * t[:, np.newaxis])
    return np.where(rates.imag >= 0, growth.real, -growth.imag)
