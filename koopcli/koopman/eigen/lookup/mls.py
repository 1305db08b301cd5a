"""Moving least squares: a linear function of the place, fitted afresh around every place (docs/equations.md 7)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from koopcli.choices import setting
from koopcli.koopman.eigen.lookup.cloud import Cloud
from koopcli.koopman.eigen.lookup.lookup import Lift
from koopcli.records import FloatArray, IndexArray

WIDTH = 0.6  # of the Gaussian weights, over the distance to the farthest neighbour
RIDGE = 1e-3  # on the slopes, over the sum of the weights
TINY = 1e-12


class MovingLeastSquares:
    """The value at a place of the linear function that fits the ``neighbours`` nearest nodes best, near ones more.

    Smooth, and blind to nodes' values but for their trend: nodes are not met exactly.
    """

    def __init__(self, nodes: Cloud) -> None:
        self._nodes = nodes

    def __call__(self, y: FloatArray) -> tuple[IndexArray, FloatArray]:
        """The neighbours (n, q) of each of ``y`` (n, n_x) and what each of their values counts."""
        near = self._nodes.near(y)
        return near, trend_weights(self._nodes.places[near] - y[:, np.newaxis])


def trend_weights(near: FloatArray) -> FloatArray:
    """The weights (n, q) of values at nodes ``near`` (n, q, n_x), for the value at zero of their linear trend (7.18).

    Slopes are held a little, so that a direction in which the nodes do not differ has none.
    """
    distance = np.linalg.norm(near, axis=2)
    width = WIDTH * distance.max(axis=1, keepdims=True) + TINY
    weight = np.exp(-((distance / width) ** 2))
    terms = np.concatenate([np.ones((*distance.shape, 1)), near / width[..., np.newaxis]], axis=2)
    weighted = terms * weight[..., np.newaxis]
    gram = np.matmul(weighted.transpose(0, 2, 1), terms)
    slopes = np.diag([0.0] + [1.0] * near.shape[2])
    gram += RIDGE * weight.sum(axis=1)[:, np.newaxis, np.newaxis] * slopes
    constant = np.zeros((*gram.shape[:2], 1))
    constant[:, 0] = 1.0
    return np.asarray(np.matmul(weighted, np.linalg.solve(gram, constant))[..., 0])


def trend_slopes(near: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The same weights (n, q), and their derivative (n, q, n_x) in the place that is zero.

    A place that moves by d sees the nodes move by -d, and the width by what the farthest one moves.
    """
    n, q, n_x = near.shape
    square = (near**2).sum(axis=2)
    far = square.argmax(axis=1)
    farthest = np.sqrt(square[np.arange(n), far])
    width = WIDTH * farthest[:, np.newaxis] + TINY
    widening = -WIDTH * near[np.arange(n), far] / np.maximum(farthest, TINY)[:, np.newaxis]  # of the width, (n, n_x)
    scaled, swelling = near / width[..., np.newaxis], widening / width
    weight = np.exp(-square / width**2)
    terms = np.concatenate([np.ones((n, q, 1)), scaled], axis=2)
    ridge = RIDGE * np.diag([0.0] + [1.0] * n_x)
    gram = np.einsum("nqa,nq,nqb->nab", terms, weight, terms) + weight.sum(axis=1)[:, np.newaxis, np.newaxis] * ridge
    constant = np.zeros((n, 1 + n_x, 1))
    constant[:, 0] = 1.0
    plane = np.linalg.solve(gram, constant)[..., 0]
    slopes = np.empty((n, q, n_x))
    for i in range(n_x):
        inwards = 2 * scaled[..., i] / width + 2 * swelling[:, i, np.newaxis] * square / width**2
        d_weight = weight * inwards
        d_terms = np.zeros_like(terms)
        d_terms[..., 1:] = -swelling[:, i, np.newaxis, np.newaxis] * scaled
        d_terms[..., 1 + i] -= 1 / width
        half = np.einsum("nqa,nq,nqb->nab", d_terms, weight, terms)
        d_gram = np.einsum("nqa,nq,nqb->nab", terms, d_weight, terms) + half + half.transpose(0, 2, 1)
        d_gram += d_weight.sum(axis=1)[:, np.newaxis, np.newaxis] * ridge
        d_plane = np.linalg.solve(gram, -np.einsum("nab,nb->na", d_gram, plane)[..., np.newaxis])[..., 0]
        slopes[..., i] = d_weight * np.einsum("nqa,na->nq", terms, plane)
        slopes[..., i] += weight * (np.einsum("nqa,na->nq", d_terms, plane) + np.einsum("nqa,na->nq", terms, d_plane))
    return weight * np.einsum("nqa,na->nq", terms, plane), slopes


@dataclass(frozen=True)
class MlsLift(Lift):
    """Moving least squares."""

    kind: ClassVar[str] = "mls"
    beyond = "continue the local linear function"
    neighbours: int = setting(24, low=1, high=10_000, help="nodes at a time")
    spacing: int | None = setting(
        None, low=1, high=1_000_000, help="samples between neighbours on one trajectory; else any"
    )

    def make(self, nodes: Cloud) -> MovingLeastSquares:
        """The lookup among ``nodes``."""
        return MovingLeastSquares(nodes)
