"""The inputs of a regression, made independent of one another."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from koopcli.records import BoolArray, FloatArray


@dataclass(frozen=True)
class WhiteInputs:
    """w = (u - ``mean``) ``T`` with the mean square I: what the inputs determine, and no more (4.5).

    ``T`` (n_u, r); ``singular`` values of the scaled inputs, one for each that is ``moving`` (n_u,): what never moves
    stays out, where it would only spoil the condition.
    """

    mean: FloatArray
    T: FloatArray
    singular: FloatArray
    moving: BoolArray

    def __call__(self, u: FloatArray) -> FloatArray:
        """w (n, r) of ``u`` (n, n_u)."""
        return _centred(u, self.mean) @ self.T


def white_inputs(blocks: Callable[[], Iterable[FloatArray]], *, centred: bool) -> WhiteInputs:
    """The inputs that each call of ``blocks()`` yields as (rows, n_u), about their mean or about zero."""
    total = sum(len(u) for u in blocks())
    mean = np.asarray(sum(u.sum(axis=0) for u in blocks()) / total)
    if not centred:
        mean = np.zeros_like(mean)
    triangle = np.empty((0, len(mean)))
    for u in blocks():
        triangle = np.asarray(np.linalg.qr(np.vstack([triangle, _centred(u, mean)]), mode="r"))
    length = np.linalg.norm(triangle, axis=0)
    moving = length > 0
    _, singular, right = np.linalg.svd(triangle[:, moving] / length[moving], full_matrices=False)
    keep = singular > singular.max(initial=0.0) * np.finfo(float).eps * total
    T = np.zeros((len(mean), int(keep.sum())))
    T[moving] = (right[keep].T / singular[keep]) / length[moving, np.newaxis] * np.sqrt(total)
    return WhiteInputs(mean, T, singular, moving)


def _centred(u: FloatArray, u_mean: FloatArray) -> FloatArray:
    """``u - u_mean`` with what is only rounding set to zero: an input that never moves determines nothing."""
    centred = u - u_mean
    centred[np.abs(centred) <= 64 * np.finfo(float).eps * np.abs(u_mean)] = 0.0
    return centred
