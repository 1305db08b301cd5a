"""What a lookup is, and what a choice of one is."""

from __future__ import annotations

from typing import ClassVar, Protocol, Self, runtime_checkable

import numpy as np

from koopcli.choices import Choice, names_of
from koopcli.errors import InvalidValueError
from koopcli.koopman.eigen.lookup.cloud import Cloud
from koopcli.records import FloatArray, IndexArray

FLAT = 1e-9  # of the largest coordinate: nodes that leave a plane by less lie in it


class Lookup(Protocol):
    """A value at y is Σ_q weights[q] · value of node indices[q]."""

    def __call__(self, y: FloatArray) -> tuple[IndexArray, FloatArray]:
        """Indices (n, q) of nodes and their weights (n, q), of sum one, for finite places ``y`` (n, n_x)."""


@runtime_checkable
class Smooth(Lookup, Protocol):
    """A lookup whose weights have a derivative."""

    def with_slopes(self, y: FloatArray) -> tuple[IndexArray, FloatArray, FloatArray]:
        """Indices and weights (n, q), and the derivative of the weights in ``y``, (n, q, n_x), with the neighbours held
        fixed.
        """


class Lift(Choice):
    """How a state is looked up. ``beyond``: what happens outside the convex hull of the nodes."""

    beyond: ClassVar[str]
    smooth: ClassVar[bool] = False
    """Whether its lookups are ``Smooth``."""
    neighbours: int = 1
    spacing: int | None = None

    def softer(self) -> list[Self]:
        """The same lookup at every softness that is tried on noisy nodes, where that is open; none of one that has
        none.
        """
        return []

    @property
    def counts_neighbours(self) -> bool:
        """Whether the number of its neighbours is a setting."""
        return "neighbours" in names_of(type(self))

    def make(self, nodes: Cloud) -> Lookup:
        """The lookup among ``nodes``."""
        raise NotImplementedError

    def fewest(self, states: int) -> int:
        """How many nodes it needs for so many ``states``."""
        return states + 1

    def check(self, places: FloatArray) -> None:
        """Raise ``InvalidValueError`` for fewer nodes at ``places`` (N, n_x) than it needs or than its neighbours, and
        for nodes in a plane.
        """
        count, n_x = places.shape
        fewest = self.fewest(n_x)
        if self.counts_neighbours and self.neighbours < fewest:
            raise InvalidValueError(
                f"'fit-eigen.neighbours' must be at least {fewest} for the lift '{self.kind}' of {n_x} states, got "
                f"{self.neighbours}"
            )
        needed = max(fewest, self.neighbours)
        more = "simulate more trajectories (sample.count, sample.budget)"
        if count < needed:
            raise InvalidValueError(
                f"the lift '{self.kind}' needs {needed} nodes and the data have {count}: {more}, keep more of each "
                "(fit-eigen.nodes), or take fewer neighbours (fit-eigen.neighbours)"
            )
        if fewest > 1 and np.linalg.matrix_rank(places - places.mean(axis=0), tol=FLAT * np.abs(places).max()) < n_x:
            raise InvalidValueError(
                f"the {count} nodes lie in a plane, where the lift '{self.kind}' knows no way out: {more}, or choose "
                "'nearest'"
            )


def no_slopes(lift: Lift) -> InvalidValueError:
    """The error of a ``lift`` without a derivative where one is asked for."""
    return InvalidValueError(
        f"the lift '{lift.kind}' has no derivative in the state, which force inputs need: fit with the lift "
        "'polyharmonic' (fit-eigen.lift)"
    )


def search(lookup: Lookup, y: FloatArray) -> tuple[IndexArray, FloatArray]:
    """What ``lookup`` finds for ``y`` (n, n_x); a place that is not finite has weights that are no numbers."""
    finite = np.isfinite(y).all(axis=1)
    if finite.all():
        return lookup(y)
    near, given = lookup(y[finite])
    indices = np.zeros((len(y), near.shape[1]), dtype=np.intp)
    weights = np.full(indices.shape, np.nan)
    indices[finite], weights[finite] = near, given
    return indices, weights


def search_slopes(lookup: Smooth, y: FloatArray) -> tuple[IndexArray, FloatArray, FloatArray]:
    """The same with the derivative of the weights in the place."""
    finite = np.isfinite(y).all(axis=1)
    if finite.all():
        return lookup.with_slopes(y)
    near, given, turning = lookup.with_slopes(y[finite])
    indices = np.zeros((len(y), near.shape[1]), dtype=np.intp)
    weights, slopes = np.full(indices.shape, np.nan), np.full((*indices.shape, y.shape[1]), np.nan)
    indices[finite], weights[finite], slopes[finite] = near, given, turning
    return indices, weights, slopes
