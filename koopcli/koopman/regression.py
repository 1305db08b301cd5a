"""Linear least squares over rows that arrive in blocks.

The normal equations are used only while their condition number is harmless, which an orthonormal basis sees to;
otherwise a QR factorisation is updated block by block.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
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


@dataclass(frozen=True)
class _Normal:
    """VᵀV and VᵀY over all ``rows``."""

    gram: FloatArray
    cross: FloatArray
    rows: int


def least_squares(blocks: RowBlocks, ridge: float = 0.0, free: Sequence[int] = ()) -> Solution:
    """Minimise Σ ‖Y_i - V_i W‖² over the blocks (V_i, Y_i) that each call of ``blocks()`` yields.

    Columns of V are scaled to norm one first, so that ``condition`` does not depend on units. ``ridge`` times the sum
    of squares of the coefficients of scaled columns is added (4.7), but for the columns ``free``. A direction below
    working precision is dropped, giving the solution of least norm; ``rank`` then tells.
    """
    normal = _normal_equations(blocks)
    scale = np.sqrt(np.diag(normal.gram))
    scale[scale == 0] = 1.0
    penalty = np.full(len(scale), ridge)
    penalty[list(free)] = 0.0
    gram = normal.gram / np.outer(scale, scale) + np.diag(penalty)
    eigenvalues = np.linalg.eigvalsh(gram)
    if eigenvalues[0] * GRAM_CONDITION > eigenvalues[-1] and (normal.rows >= len(gram) or ridge > 0):
        W = np.linalg.solve(gram, normal.cross / scale[:, np.newaxis])
        return Solution(W / scale[:, np.newaxis], np.sqrt(eigenvalues), len(gram))
    return _by_qr(blocks, scale, normal.rows, penalty)


def cholesky(blocks: RowBlocks) -> Solution:
    """The same minimum from the normal equations as they stand, which squares the condition of columns as they are.

    What a textbook writes and many programs do; it is here to show where it ends. Raises ``InvalidValueError`` when
    rounding has left VᵀV without a factor.
    """
    from scipy.linalg import solve_triangular  # noqa: PLC0415  (other fits go without)

    normal = _normal_equations(blocks)
    try:
        L = np.linalg.cholesky(normal.gram)
    except np.linalg.LinAlgError as error:
        raise InvalidValueError(
            f"the normal equations of {len(normal.gram)} raw columns have lost all their digits (their matrix is not "
            "positive definite any more): lower fit-edmd.order, or use the solver 'orthonormal'"
        ) from error
    W = solve_triangular(L.T, solve_triangular(L, normal.cross, lower=True))
    return Solution(np.asarray(W), np.asarray(np.linalg.svd(L, compute_uv=False)), len(L))


def _normal_equations(blocks: RowBlocks) -> _Normal:
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
    return _Normal(gram, cross, rows)


def _by_qr(blocks: RowBlocks, scale: FloatArray, rows: int, penalty: FloatArray) -> Solution:
    """The same minimum from the triangular factor of [V Y], kept while the blocks pass by."""
    columns = len(scale)
    triangle: FloatArray | None = None
    for V, Y in blocks():
        stacked = np.hstack([V / scale, Y])
        if triangle is None:
            punished = np.diag(np.sqrt(penalty))[penalty > 0]
            triangle = np.hstack([punished, np.zeros((len(punished), Y.shape[1]))])
        triangle = np.asarray(np.linalg.qr(np.vstack([triangle, stacked]), mode="r"))
    assert triangle is not None
    R, S = triangle[:columns, :columns], triangle[:columns, columns:]
    U, singular, Vt = np.linalg.svd(R, full_matrices=False)
    keep = singular > singular[0] * np.finfo(float).eps * max(rows, columns)
    W = Vt[keep].T @ ((U[:, keep].T @ S) / singular[keep][:, np.newaxis])
    return Solution(W / scale[:, np.newaxis], singular, int(keep.sum()))
