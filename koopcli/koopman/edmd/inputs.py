"""The inputs of a regression, made independent of one another."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from koopcli.content import Content
from koopcli.records import Array, BoolArray, FloatArray, Packed

STILL = 64 * np.finfo(float).eps  # of its size: an input that moves by no more is still


@dataclass(frozen=True, eq=False, repr=False)
class WhiteInputs(Content):
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
        return np.asarray((u - self.mean) @ self.T)

    def pack(self) -> Packed:
        """What another process needs to apply them."""
        return Packed({"mean": Array(self.mean, ("input",), "1"), "T": Array(self.T, ("input", "direction"), "1")})

    @classmethod
    def unpack(cls, packed: Packed) -> WhiteInputs:
        """The inverse of :meth:`pack`, but for what only says how independent they are."""
        mean, T = (packed.arrays[name].values[...] for name in ("mean", "T"))
        return cls(mean, T, np.empty(0), T.any(axis=1))


def white_inputs(triangle: FloatArray, ends: FloatArray, *, centred: bool) -> WhiteInputs:
    """The inputs about their mean or about zero, from the R (1 + n_u, 1 + n_u) of a QR factorisation of [1, u].

    Its first row holds the sums over all samples, and what is below it the R of the inputs about their mean. ``ends``
    (2, n_u), the smallest and largest of each, say whether one moves: of one that does not, R holds rounding.
    """
    total = triangle[0, 0] ** 2
    if centred:
        mean, moved = triangle[0, 1:] / triangle[0, 0], triangle[1:, 1:]
    else:
        mean, moved = np.zeros(triangle.shape[1] - 1), np.asarray(np.linalg.qr(triangle[:, 1:], mode="r"))
    length = np.linalg.norm(moved, axis=0)
    moving = np.ptp(ends, axis=0) > STILL * np.abs(ends).max(axis=0) if centred else np.asarray(ends.any(axis=0))
    _, singular, right = np.linalg.svd(moved[:, moving] / length[moving], full_matrices=False)
    keep = singular > singular.max(initial=0.0) * np.finfo(float).eps * total
    T = np.zeros((len(mean), int(keep.sum())))
    T[moving] = (right[keep].T / singular[keep]) / length[moving, np.newaxis] * np.sqrt(total)
    return WhiteInputs(mean, T, singular, moving)
