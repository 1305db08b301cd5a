"""Least squares on centred columns of equal spread, from sums about their means that are collected block by block."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.koopman.edmd.inputs import STILL
from koopcli.koopman.edmd.regression import ROUNDING, condition_number
from koopcli.records import BoolArray, FloatArray


@dataclass(frozen=True)
class Centred:
    """The ``mean`` (m,), the ``gram`` matrix (m, m) of the deviations from it, and the smallest and largest ``ends``
    (2, m) of m columns over ``rows`` rows.
    """

    rows: int
    mean: FloatArray
    gram: FloatArray
    ends: FloatArray

    @classmethod
    def of(cls, values: FloatArray) -> Centred:
        """The sums of ``values`` (n, m)."""
        with np.errstate(over="ignore", invalid="ignore"):  # refused by whoever solves
            mean = values.mean(axis=0)
            off = values - mean
            gram = off.T @ off
        return cls(len(values), mean, gram, np.stack([values.min(axis=0), values.max(axis=0)]))

    def __add__(self, other: Centred) -> Centred:
        """The sums of both blocks together."""
        rows = self.rows + other.rows
        apart = other.mean - self.mean
        gram = self.gram + other.gram + np.outer(apart, apart) * (self.rows * other.rows / rows)
        lower, upper = np.minimum(self.ends[0], other.ends[0]), np.maximum(self.ends[1], other.ends[1])
        return Centred(rows, self.mean + apart * (other.rows / rows), gram, np.stack([lower, upper]))

    @property
    def moving(self) -> BoolArray:
        """Which columns change by more than rounding, (m,)."""
        return np.asarray(np.ptp(self.ends, axis=0) > STILL * np.abs(self.ends).max(axis=0))


class Affine(NamedTuple):
    """y ≈ v · ``slopes`` + ``offset``, with slopes (columns, targets), and what the regression found."""

    slopes: FloatArray
    offset: FloatArray
    rank: int
    directions: int
    condition: float


def together(blocks: Iterable[FloatArray]) -> Centred:
    """The sums over all ``blocks`` (n, m). Raises ``InvalidValueError`` where there are none or some not finite."""
    total: Centred | None = None
    for values in blocks:
        part = Centred.of(values)
        total = part if total is None else total + part
    if total is None:
        raise InvalidValueError("there are no samples to fit")
    if not np.isfinite(total.gram).all():
        raise InvalidValueError("the training data hold values that are not finite, or whose squares are not")
    return total


def affine(sums: Centred, columns: int, ridge: float) -> Affine:
    """The least squares of all columns after the first ``columns`` on those and a constant.

    (VᵀV/rows + ridge I) W = VᵀY/rows with V the constant and the columns, centred and divided by their standard
    deviation, so that neither their units nor their signs matter and a large ``ridge`` gives y = 0. A column that never
    moves has no slope; directions that rounding has emptied have none either.
    """
    moving = sums.moving[:columns]
    gram, cross = sums.gram[:columns, :columns] / sums.rows, sums.gram[:columns, columns:] / sums.rows
    scale = np.sqrt(np.diag(gram)[moving])
    standard = gram[np.ix_(moving, moving)] / np.outer(scale, scale)
    eigenvalues, Q = np.linalg.eigh(standard)
    damped = np.maximum(eigenvalues, 0.0) + ridge
    keep = damped > ROUNDING * len(damped) * damped.max(initial=0.0)
    W = Q[:, keep] @ ((Q[:, keep].T @ (cross[moving] / scale[:, np.newaxis])) / damped[keep, np.newaxis])
    slopes = np.zeros(cross.shape)
    slopes[moving] = W / scale[:, np.newaxis]
    offset = sums.mean[columns:] / (1.0 + ridge) - sums.mean[:columns] @ slopes
    condition = condition_number(np.sqrt(np.append(damped, 1.0 + ridge)))
    return Affine(slopes, offset, int(keep.sum()) + 1, len(damped) + 1, condition)
