"""The samples whose values are looked up, and where they lie (docs/equations.md 7)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from koopcli.checks import restored
from koopcli.choices import written
from koopcli.content import Content
from koopcli.koopman.eigen.lookup.cloud import Cloud
from koopcli.koopman.eigen.lookup.lookup import Lift, Lookup, Smooth, no_slopes, search, search_slopes
from koopcli.koopman.predictor.places import place_slopes, placed
from koopcli.records import OF_STATES, Array, FloatArray, IndexArray, Meta, Packed

BISECTIONS = 40
CLOSE = 0.01  # of the wanted number of nodes: near enough
TINY = 1e-12
SMALLEST = 1e-4  # of a voxel, in units of place


@dataclass(frozen=True, eq=False, repr=False)
class Search(Content):
    """How nodes are looked up: by a ``lift``, at distances between the places of states by ``scale`` and ``power`` (see
    ``placed``).
    """

    lift: Lift
    scale: FloatArray
    power: float = 1.0

    def place(self, x: FloatArray) -> FloatArray:
        """Where the states ``x`` (n, n_x) lie, (n, n_x), eq. (7.12)."""
        return placed(x, self.scale, self.power)


@dataclass(frozen=True, eq=False, repr=False)
class Nodes(Content):
    """Which samples of trajectories are looked up: ``states`` (N, n_x), and their numbers ``kept`` (N,) among the
    first ``samples`` samples of each, trajectory by trajectory.
    """

    search: Search
    states: FloatArray
    kept: IndexArray
    samples: int

    @property
    def trajectory(self) -> IndexArray:
        """The trajectory of each node, (N,)."""
        return np.asarray(self.kept // self.samples)

    @property
    def sample(self) -> IndexArray:
        """The sample of each node, (N,)."""
        return np.asarray(self.kept % self.samples)

    def find(self, x: FloatArray) -> tuple[IndexArray, FloatArray]:
        """Nodes (n, q) for the states ``x`` (n, n_x), and what each counts; a state that is not finite has none."""
        return search(self._lookup, self.search.place(x))

    def find_slopes(self, x: FloatArray) -> tuple[IndexArray, FloatArray, FloatArray]:
        """The same, and the derivative of what each counts in ``x``, (n, q, n_x), with the nodes found held fixed.

        Raises ``InvalidValueError`` for a lookup without a derivative.
        """
        how, lookup = self.search, self._lookup
        if not isinstance(lookup, Smooth):
            raise no_slopes(how.lift)
        indices, weights, slopes = search_slopes(lookup, how.place(x))
        return indices, weights, np.matmul(slopes, place_slopes(x, how.scale, how.power))

    def only(self, chosen: IndexArray) -> Nodes:
        """Those nodes alone."""
        return Nodes(self.search, self.states[chosen], self.kept[chosen], self.samples)

    def looked_up_by(self, lift: Lift) -> Nodes:
        """The same nodes under another lookup."""
        return replace(self, search=replace(self.search, lift=lift))

    @cached_property
    def _lookup(self) -> Lookup:
        lift, places = self.search.lift, self.search.place(self.states)
        lift.check(places)
        return lift.make(Cloud(places, self.trajectory, self.sample, lift.neighbours, lift.spacing))

    def pack(self) -> Packed:
        """The nodes for storage, by number: their states are with the trajectories."""
        arrays = {
            "nodes": Array(self.kept, ("node",), "1"),
            "scale": Array(self.search.scale, ("state",), OF_STATES),
        }
        return Packed(arrays, self.about)

    @property
    def about(self) -> Meta:
        """How they are looked up, as JSON."""
        return {"lift": written(self.search.lift), "power": self.search.power, "samples": self.samples}

    @classmethod
    def unpack(cls, packed: Packed, trajectories: FloatArray) -> Nodes:
        """The inverse of :meth:`pack`, of ``trajectories`` (J, samples or more, n_x)."""
        meta = packed.meta
        scale, kept = packed.arrays["scale"].values[...], packed.arrays["nodes"].values[...]
        how = Search(restored(Lift, meta["lift"]), scale, meta["power"])
        j, k = np.divmod(kept, meta["samples"])
        return cls(how, trajectories[j, k], kept, meta["samples"])


def nodes_of(x: FloatArray, samples: int, search: Search, most: int | None = None) -> Nodes:
    """The nodes among the first ``samples`` samples of ``x`` (J, samples or more, n_x), at ``most`` so many of each.

    Raises ``InvalidValueError`` where fewer are kept than the lookup needs, and where they lie in a plane.
    """
    states = x[:, :samples].reshape(-1, x.shape[2])
    kept = np.arange(len(states))
    if most is not None:
        late = kept % samples
        kept = thinned(search.place(states), np.argsort(late, kind="stable"), most * len(x))
    search.lift.check(search.place(states[kept]))
    return Nodes(search, states[kept], kept, samples)


def thinned(places: FloatArray, order: IndexArray, most: int) -> IndexArray:
    """At most ``most`` of ``places`` (n, n_x): the first by ``order`` in each voxel of a size found by bisection."""
    if len(places) <= most:
        return np.arange(len(places))
    ordered = places[order]
    low, high = SMALLEST, 2 * float(np.abs(places).max()) + TINY
    best = order[:1]
    for _ in range(BISECTIONS):
        size = (low * high) ** 0.5
        first = _first_in_each(np.floor(ordered / size).astype(np.int64))
        if len(first) > most:
            low = size
            continue
        high, best = size, order[first]
        if len(first) >= (1 - CLOSE) * most:
            break
    return np.asarray(np.sort(best))


def _first_in_each(voxels: IndexArray) -> IndexArray:
    """The first row of each different one of ``voxels`` (n, n_x)."""
    low = voxels.min(axis=0)
    spans = voxels.max(axis=0) - low + 1
    if np.prod(spans.astype(float)) > 2.0**62:
        return np.asarray(np.unique(voxels, axis=0, return_index=True)[1])
    number = np.zeros(len(voxels), dtype=np.int64)
    for column, span in zip((voxels - low).T, spans, strict=True):
        number = number * span + column
    return np.asarray(np.unique(number, return_index=True)[1])
