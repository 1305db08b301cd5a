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
ROUNDING = 64 * float(np.finfo(float).eps)  # of the entries of VᵀV, however it was summed


@dataclass(frozen=True)
class Solution:
    """``coefficients`` (columns, targets), the ``singular_values`` of the scaled rows and their numerical ``rank``;
    ``solved_by``: the way that was taken, in a word or two.
    """

    coefficients: FloatArray
    singular_values: FloatArray
    rank: int
    solved_by: str

    @property
    def condition(self) -> float:
        """Largest over smallest singular value."""
        return condition_number(self.singular_values)


def condition_number(singular_values: FloatArray) -> float:
    """Largest over smallest of ``singular_values``; infinite where one is zero."""
    smallest = float(singular_values.min())
    return float(singular_values.max()) / smallest if smallest > 0 else float("inf")


@dataclass(frozen=True)
class Normal:
    """VᵀV and VᵀY over all ``rows``; ``lost``: how much of its scaled entries the way of summing VᵀV has lost."""

    gram: FloatArray
    cross: FloatArray
    rows: int
    lost: float = 0.0

    def __post_init__(self) -> None:
        if not (np.isfinite(self.gram).all() and np.isfinite(self.cross).all()):
            raise InvalidValueError("the training data hold values that are not finite: simulate a tamer sample")


@dataclass(frozen=True)
class Scaled:
    """Normal equations for columns of norm one, with the penalty of a ridge (4.7) on all but those that are free."""

    normal: Normal
    scale: FloatArray
    penalty: FloatArray
    gram: FloatArray
    eigenvalues: FloatArray

    @classmethod
    def of(cls, normal: Normal, ridge: float = 0.0, free: Sequence[int] = ()) -> Scaled:
        """The scaled equations; ``ridge`` times the sum of squares of the coefficients is added, but for ``free``."""
        scale = np.sqrt(np.maximum(np.diag(normal.gram), 0.0))  # rounding may leave a column that is nothing below it
        scale[scale == 0] = 1.0
        penalty = np.full(len(scale), ridge)
        penalty[list(free)] = 0.0
        gram = normal.gram / np.outer(scale, scale) + np.diag(penalty)
        return cls(normal, scale, penalty, gram, np.linalg.eigvalsh(gram))

    @property
    def condition(self) -> float:
        """The condition number of the matrix itself, which is that of the rows squared."""
        return float(self.eigenvalues[-1] / self.eigenvalues[0]) if self.eigenvalues[0] > 0 else float("inf")

    @property
    def harmless(self) -> bool:
        """Whether their solution keeps its digits."""
        determined = self.normal.rows >= len(self.gram) or bool(self.penalty.any())
        return determined and self.condition * max(1.0, self.normal.lost / ROUNDING) < GRAM_CONDITION

    def solution(self, solved_by: str) -> Solution:
        """The coefficients of the columns as they are."""
        W = np.linalg.solve(self.gram, self.normal.cross / self.scale[:, np.newaxis])
        return Solution(W / self.scale[:, np.newaxis], np.sqrt(self.eigenvalues), len(self.gram), solved_by)

    def by_triangle(self, triangle: FloatArray) -> Solution:
        """The same minimum from the R of a QR factorisation of the rows [V / scale, Y]."""
        columns = len(self.scale)
        punished = np.diag(np.sqrt(self.penalty))[self.penalty > 0]
        if len(punished):
            triangle = add_rows(triangle, np.hstack([punished, np.zeros((len(punished), triangle.shape[1] - columns))]))
        R, S = triangle[:columns, :columns], triangle[:columns, columns:]
        U, singular, Vt = np.linalg.svd(R, full_matrices=False)
        keep = singular > singular[0] * np.finfo(float).eps * max(self.normal.rows, columns)
        W = Vt[keep].T @ ((U[:, keep].T @ S) / singular[keep][:, np.newaxis])
        return Solution(W / self.scale[:, np.newaxis], singular, int(keep.sum()), "QR")


def least_squares(blocks: RowBlocks, ridge: float = 0.0, free: Sequence[int] = ()) -> Solution:
    """Minimise Σ ‖Y_i - V_i W‖² over the blocks (V_i, Y_i) that each call of ``blocks()`` yields.

    Columns of V are scaled to norm one first, so that ``condition`` does not depend on units. ``ridge`` times the sum
    of squares of the coefficients of scaled columns is added (4.7), but for the columns ``free``. A direction below
    working precision is dropped, giving the solution of least norm; ``rank`` then tells.
    """
    scaled = Scaled.of(normal_equations(blocks), ridge, free)
    if scaled.harmless:
        return scaled.solution("normal equations")
    triangle: FloatArray | None = None
    for V, Y in blocks():
        rows = np.hstack([V / scaled.scale, Y])
        triangle = add_rows(rows[:0] if triangle is None else triangle, rows)
    assert triangle is not None, "the same blocks as before"
    return scaled.by_triangle(triangle)


def cholesky(normal: Normal) -> Solution:
    """The same minimum from the normal equations as they stand, which squares the condition of columns as they are.

    What a textbook writes and many programs do; it is here to show where it ends. Raises ``InvalidValueError`` when
    rounding has left VᵀV without a factor.
    """
    from scipy.linalg import solve_triangular  # noqa: PLC0415  (other fits go without)

    try:
        L = np.linalg.cholesky(normal.gram)
    except np.linalg.LinAlgError as error:
        raise InvalidValueError(
            f"the normal equations of {len(normal.gram)} raw columns have lost all their digits (their matrix is not "
            "positive definite any more): lower fit-edmd.order, or use the solver 'orthonormal'"
        ) from error
    W = solve_triangular(L.T, solve_triangular(L, normal.cross, lower=True))
    return Solution(np.asarray(W), np.asarray(np.linalg.svd(L, compute_uv=False)), len(L), "Cholesky")


def normal_equations(blocks: RowBlocks) -> Normal:
    """Both sums over the blocks (V_i, Y_i). Raises ``InvalidValueError`` where there are none or some not finite."""
    gram = cross = None
    rows = 0
    for V, Y in blocks():
        with np.errstate(over="ignore", invalid="ignore"):  # refused below, in words
            gram = V.T @ V + (0 if gram is None else gram)
            cross = V.T @ Y + (0 if cross is None else cross)
        rows += len(V)
    if gram is None or cross is None:
        raise InvalidValueError("there are no samples to fit")
    return Normal(gram, cross, rows)


def add_rows(triangle: FloatArray, *rows: FloatArray) -> FloatArray:
    """The R of a QR factorisation with more ``rows`` below ``triangle``."""
    return np.asarray(np.linalg.qr(np.vstack([triangle, *rows]), mode="r"))
