"""Linear least squares over rows that arrive in blocks.

The normal equations are used only while their condition number is harmless, which an orthonormal basis sees to;
otherwise a QR factorisation is updated block by block.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.records import FloatArray

RowBlocks = Callable[[], Iterable[tuple[FloatArray, FloatArray]]]

GRAM_CONDITION = 1e6  # of VᵀV: up to it rounding leaves ten of sixteen digits


@dataclass(frozen=True)
class Solution:
    """``coefficients`` (columns, targets), the ``singular_values`` of the scaled rows and their numerical ``rank``."""

    coefficients: FloatArray
    singular_values: FloatArray
    rank: int

    @property
    def condition(self) -> float:
        """Largest over smallest singular value."""
        return condition_number(self.singular_values)


def condition_number(singular_values: FloatArray) -> float:
    """Largest over smallest of ``singular_values``; infinite where one is zero."""
    smallest = float(singular_values.min())
    return float(singular_values.max()) / smallest if smallest > 0 else float("inf")


def least_squares(blocks: RowBlocks) -> Solution:
    """Minimise Σ ‖Y_i - V_i W‖² over the blocks (V_i, Y_i) that each call of ``blocks()`` yields.

    Columns of V are scaled to equal norm first, so that ``condition`` does not depend on units. A direction below
    working precision is dropped, giving the solution of least norm; ``rank`` then tells.
    """
    gram = cross = None
    rows = 0
    for V, Y in blocks():
        with np.errstate(over="ignore", invalid="ignore"):  # refused below, in words
            gram = V.T @ V + (0 if gram is None else gram)
            cross = V.T @ Y + (0 if cross is None else cross)
        rows += len(V)
    if gram is None or cross is None:
        raise InvalidValueError("there are no samples to fit")
    if not (np.isfinite(gram).all() and np.isfinite(cross).all()):
        raise InvalidValueError("the training data hold values that are not finite: simulate a tamer sample")
    scale = np.sqrt(np.diag(gram))
    scale[scale == 0] = 1.0
    gram = gram / np.outer(scale, scale)
    eigenvalues = np.linalg.eigvalsh(gram)
    if eigenvalues[0] * GRAM_CONDITION > eigenvalues[-1] and rows >= len(gram):
        W = np.linalg.solve(gram, cross / scale[:, np.newaxis])
        return Solution(W / scale[:, np.newaxis], np.sqrt(eigenvalues), len(gram))
    return _by_qr(blocks, scale, rows)


def _by_qr(blocks: RowBlocks, scale: FloatArray, rows: int) -> Solution:
    """The same minimum from the triangular factor of [V Y], kept while the blocks pass by."""
    columns = len(scale)
    triangle: FloatArray | None = None
    for V, Y in blocks():
        stacked = np.hstack([V / scale, Y])
        above = np.empty((0, stacked.shape[1])) if triangle is None else triangle
        triangle = np.asarray(np.linalg.qr(np.vstack([above, stacked]), mode="r"))
    assert triangle is not None
    R, S = triangle[:columns, :columns], triangle[:columns, columns:]
    U, singular, Vt = np.linalg.svd(R, full_matrices=False)
    keep = singular > singular[0] * np.finfo(float).eps * max(rows, columns)
    W = Vt[keep].T @ ((U[:, keep].T @ S) / singular[keep][:, np.newaxis])
    return Solution(W / scale[:, np.newaxis], singular, int(keep.sum()))
