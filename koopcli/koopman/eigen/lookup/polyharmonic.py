"""Local polyharmonic splines: r³ on the nearest nodes, and a quadratic (docs/equations.md 7)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import ClassVar

import numpy as np

from koopcli.choices import setting
from koopcli.koopman.eigen.lookup.cloud import Cloud
from koopcli.koopman.eigen.lookup.lookup import Lift
from koopcli.koopman.eigen.lookup.mls import trend_slopes, trend_weights
from koopcli.records import BoolArray, FloatArray, IndexArray

TOGETHER = 128  # places solved for at once
STIFF = 1e-9  # softness of a spline that meets its nodes
LARGEST = 10.0  # sum of absolute weights, beyond which a simpler spline is taken
SIMPLER = (STIFF, 1e-4, 1e-2)  # softnesses of a linear tail, one after the other
SOFTER = (STIFF, 1e-4, 1e-3, 3e-3, 1e-2, 3e-2, 1e-1, 3e-1, 1.0)  # tried where nodes are noisy


class Polyharmonic:
    """The spline of r³ with a quadratic tail through the neighbours of a place, read there.

    Meets the nodes' values, and those of any quadratic function everywhere. Distances are divided by that of the
    farthest neighbour, which keeps every small system alike. Where neighbours lie nearly in a plane or on a line, the
    weights grow far beyond one and with them every error of the nodes: such a place has a linear tail instead, then a
    softer spline, and in the end no more than the trend of its neighbours.
    """

    def __init__(self, nodes: Cloud, softness: float = STIFF) -> None:
        self._nodes, self._softness = nodes, softness

    def __call__(self, y: FloatArray) -> tuple[IndexArray, FloatArray]:
        """The neighbours (n, q) of each of ``y`` (n, n_x) and what each of their values counts."""
        near = self._nodes.near(y)
        weights = np.empty(near.shape)
        for start in range(0, len(y), TOGETHER):
            rows = slice(start, start + TOGETHER)
            weights[rows] = _bounded(self._around(y[rows], near[rows])[0], self._softness)
        return near, weights

    def with_slopes(self, y: FloatArray) -> tuple[IndexArray, FloatArray, FloatArray]:
        """The same, and the derivative of the weights in ``y``, (n, q, n_x), with the neighbours held fixed (7.22)."""
        near = self._nodes.near(y)
        weights, slopes = np.empty(near.shape), np.empty((*near.shape, y.shape[1]))
        for start in range(0, len(y), TOGETHER):
            rows = slice(start, start + TOGETHER)
            around, size = self._around(y[rows], near[rows])
            weights[rows], slopes[rows] = _bounded_with_slopes(around, self._softness)
            slopes[rows] /= size
        return near, weights, slopes

    def _around(self, y: FloatArray, near: IndexArray) -> tuple[FloatArray, FloatArray]:
        """The neighbours (n, q, n_x) as seen from ``y`` (n, n_x), in the distances (n, 1, 1) of the farthest ones."""
        way = self._nodes.places[near] - y[:, np.newaxis]
        size = np.sqrt((way**2).sum(axis=2).max(axis=1))
        size = np.maximum(size, np.finfo(float).tiny)[:, np.newaxis, np.newaxis]
        return way / size, size


def _bounded(near: FloatArray, softness: float) -> FloatArray:
    """The weights (n, q), simpler where they would be large."""
    weights = spline_weights(near, 2, softness)
    wild = np.flatnonzero(_wild(weights))
    for softer in SIMPLER:
        if not len(wild):
            return weights
        weights[wild] = spline_weights(near[wild], 1, max(softness, softer))
        wild = wild[_wild(weights[wild])]
    weights[wild] = trend_weights(near[wild])
    return weights


def _bounded_with_slopes(near: FloatArray, softness: float) -> tuple[FloatArray, FloatArray]:
    """The same weights, and the slopes (n, q, n_x) of those of the spline that is taken."""
    weights, slopes = spline_slopes(near, 2, softness)
    wild = np.flatnonzero(_wild(weights))
    for softer in SIMPLER:
        if not len(wild):
            return weights, slopes
        weights[wild], slopes[wild] = spline_slopes(near[wild], 1, max(softness, softer))
        wild = wild[_wild(weights[wild])]
    weights[wild], slopes[wild] = trend_slopes(near[wild])
    return weights, slopes


def _wild(weights: FloatArray) -> BoolArray:
    return ~np.asarray(np.abs(weights).sum(axis=1) <= LARGEST)


def spline_weights(near: FloatArray, degree: int, softness: float) -> FloatArray:
    """The weights (n, q) of values at nodes ``near`` (n, q, n_x), for the value at zero, eq. (7.19).

    Solves [Φ + softness P; Pᵀ 0] [w; ·] = [φ; p] with Φ = |y_i - y_j|³, P the monomials to ``degree`` one or two, φ and
    p those of zero.
    """
    q = near.shape[1]
    system, square = _system(near, degree, softness)
    right = np.zeros((*system.shape[:2], 1))
    right[:, :q, 0] = square * np.sqrt(square)
    right[:, q, 0] = 1.0
    return np.asarray(np.linalg.solve(system, right)[:, :q, 0])


def spline_slopes(near: FloatArray, degree: int, softness: float) -> tuple[FloatArray, FloatArray]:
    """The same weights (n, q), and their derivative (n, q, n_x) in the place that is zero (7.22), by one solution.

    A place that moves by d sees the nodes move by -d, and all of them nearer or farther in the distance of the farthest
    one. The system changes by no more than its tail does, which spans the same; so the right side alone moves: φ by
    -3 |y_i| y_i and p by the unit vectors. The softness is a share of that distance cubed: where it counts, what it
    changes is solved for too.
    """
    n, q, n_x = near.shape
    system, square = _system(near, degree, softness)
    distance = np.sqrt(square)
    right = np.zeros((*system.shape[:2], 1 + n_x))
    right[:, :q, 0] = square * distance
    right[:, q, 0] = 1.0
    right[:, :q, 1:] = -3.0 * distance[..., np.newaxis] * near
    right[:, q + 1 : q + 1 + n_x, 1:] = np.eye(n_x)
    solved = np.asarray(np.linalg.solve(system, right), dtype=float)[:, :q]
    weights, slopes = solved[..., 0], solved[..., 1:]
    if softness > STIFF:
        right = np.zeros((*system.shape[:2], 1))
        right[:, :q, 0] = 3.0 * softness * weights
        swelling = np.linalg.solve(system, right)[:, :q]
        slopes = slopes + swelling * near[np.arange(n), square.argmax(axis=1)][:, np.newaxis]
    return weights, slopes


def _system(near: FloatArray, degree: int, softness: float) -> tuple[FloatArray, FloatArray]:
    """The matrix of (7.19), (n, q + m, q + m), and the squared distances (n, q) from zero."""
    n, q, n_x = near.shape
    rows, columns = _products(n_x, degree)
    linear, m = q + 1 + n_x, 1 + n_x + len(rows)
    system = np.zeros((n, q + m, q + m))
    square = np.einsum("nqi,nqi->nq", near, near)
    between = np.matmul(near, near.transpose(0, 2, 1))
    between *= -2.0
    between += square[:, :, np.newaxis]
    between += square[:, np.newaxis]
    np.maximum(between, 0.0, out=between)
    np.multiply(between, np.sqrt(between), out=system[:, :q, :q])
    system[:, :q, q] = 1.0
    system[:, :q, q + 1 : linear] = near
    system[:, :q, linear:] = near[:, :, rows] * near[:, :, columns]
    system[:, q:, :q] = system[:, :q, q:].transpose(0, 2, 1)
    diagonal = np.einsum("nii->ni", system)
    diagonal[:, :q] = softness
    diagonal[:, q:] = -1e-3 * STIFF  # a tail that the nodes leave open is not used
    return system, square


@cache
def _products(n_x: int, degree: int) -> tuple[IndexArray, IndexArray]:
    """The factors of the quadratic monomials, if the ``degree`` is two."""
    rows, columns = np.triu_indices(n_x if degree == 2 else 0)
    return rows, columns


@dataclass(frozen=True)
class PolyharmonicLift(Lift):
    """Local polyharmonic splines."""

    kind: ClassVar[str] = "polyharmonic"
    beyond = "continue the local spline, which bends there"
    smooth = True
    neighbours: int = setting(60, low=1, high=10_000, help="nodes at a time")
    spacing: int | None = setting(
        None, low=1, high=1_000_000, help="samples between neighbours on one trajectory; else any"
    )
    softness: float | None = setting(
        None,
        above=0,
        high=10,
        help="how far a spline passes by its nodes, as a share of the farthest one's distance cubed; else it meets "
        "them, and where noise is smoothed what predicts trajectories held back best is taken",
    )

    def make(self, nodes: Cloud) -> Polyharmonic:
        """The lookup among ``nodes``."""
        return Polyharmonic(nodes, STIFF if self.softness is None else self.softness)

    def softer(self) -> list[PolyharmonicLift]:
        """One for each softness, if that is open."""
        return [replace(self, softness=softness) for softness in SOFTER] if self.softness is None else []

    def fewest(self, states: int) -> int:
        """As many as a quadratic has coefficients."""
        return (states + 1) * (states + 2) // 2
