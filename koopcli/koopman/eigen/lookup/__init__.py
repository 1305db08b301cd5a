"""From nodes with known values to any other place: which nodes, with what weights (docs/equations.md 7).

A new way is one file and one line in ``LOOKUPS``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.koopman.eigen.lookup.cloud import Cloud
from koopcli.koopman.eigen.lookup.linear import Linear
from koopcli.koopman.eigen.lookup.mls import MovingLeastSquares
from koopcli.koopman.eigen.lookup.nearest import Nearest
from koopcli.koopman.eigen.lookup.polyharmonic import Polyharmonic
from koopcli.records import FloatArray, IndexArray

FLAT = 1e-9  # of the largest coordinate: nodes that leave a plane by less lie in it


class Lookup(Protocol):
    """A value at y is Σ_q weights[q] · value of node indices[q]."""

    def __call__(self, y: FloatArray) -> tuple[IndexArray, FloatArray]:
        """Indices (n, q) of nodes and their weights (n, q), of sum one, for finite places ``y`` (n, n_x)."""


@dataclass(frozen=True)
class Kind:
    """A way to look up: ``make`` it of nodes; ``fewest(n_x)`` nodes it needs; ``neighbours`` it takes unless told
    otherwise, None where it has no such number; ``beyond``: what happens outside the convex hull of the nodes.
    """

    make: Callable[[Cloud], Lookup]
    fewest: Callable[[int], int]
    neighbours: int | None
    beyond: str


LOOKUPS: dict[str, Kind] = {
    "nearest": Kind(Nearest, lambda n_x: 1, None, "take the nearest sample, as everywhere"),
    "linear": Kind(Linear, lambda n_x: n_x + 1, None, "take the nearest sample"),
    "mls": Kind(MovingLeastSquares, lambda n_x: n_x + 1, 24, "continue the local linear function"),
    "polyharmonic": Kind(
        Polyharmonic, lambda n_x: (n_x + 1) * (n_x + 2) // 2, 60, "continue the local spline, which bends there"
    ),
}


def check_nodes(kind: str, places: FloatArray, neighbours: int | None) -> int:
    """How many neighbours the lookup of ``kind`` takes of nodes at ``places`` (N, n_x).

    Raises ``InvalidValueError`` for fewer nodes than it needs or than its ``neighbours``, and for nodes in a plane.
    """
    about = LOOKUPS[kind]
    count, n_x = places.shape
    wanted = neighbours or about.neighbours or 1
    fewest = about.fewest(n_x)
    if about.neighbours is not None and wanted < fewest:
        raise InvalidValueError(
            f"'fit-eigen.neighbours' must be at least {fewest} for the lift '{kind}' of {n_x} states, got {wanted}"
        )
    more = "simulate more trajectories (sample.count, sample.budget)"
    if count < max(fewest, wanted):
        raise InvalidValueError(
            f"the lift '{kind}' needs {max(fewest, wanted)} nodes and the data have {count}: {more}, keep more of each "
            "(fit-eigen.nodes), or take fewer neighbours (fit-eigen.neighbours)"
        )
    if fewest > 1 and np.linalg.matrix_rank(places - places.mean(axis=0), tol=FLAT * np.abs(places).max()) < n_x:
        raise InvalidValueError(
            f"the {count} nodes lie in a plane, where the lift '{kind}' knows no way out: {more}, or choose 'nearest'"
        )
    return wanted


def search(lookup: Lookup, y: FloatArray) -> tuple[IndexArray, FloatArray]:
    """What ``lookup`` finds for ``y`` (n, n_x); a place that is not finite has weights that are no numbers."""
    finite = np.isfinite(y).all(axis=1)
    if finite.all():
        return lookup(y)
    found, given = lookup(y[finite])
    indices = np.zeros((len(y), found.shape[1]), dtype=np.intp)
    weights = np.full(indices.shape, np.nan)
    indices[finite], weights[finite] = found, given
    return indices, weights
