"""Lifted states from what followed nearby samples, over the horizon and no further (docs/equations.md 7)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from koopcli.content import Content
from koopcli.koopman.eigen.frames import FRAMES
from koopcli.koopman.eigen.nodes import Nodes
from koopcli.koopman.predictor.lifts import Observed
from koopcli.koopman.predictor.modes import Modes
from koopcli.records import OF_STATES, Array, FloatArray, IndexArray, Meta, Packed

TOGETHER = 4096  # states lifted at once
LARGEST_TABLE = 3e8  # bytes of what follows all nodes; a larger one is not made
FEW = 8  # states for which no sparse matrix is made
GATHERED = 128  # states whose nodes' futures are then put together at once


@dataclass(frozen=True, eq=False, repr=False)
class Futures(Content):
    """ψ(x): the exponentials that fit the interpolated future of x best (7.16).

    ``trajectories`` (J, samples, n_x); ``nodes``: those of their samples that are looked up; ``frame``: in which what
    follows them is interpolated; ``projection`` (L, horizon + 1): from the samples of a future to the states of a
    block of ``modes``, of which each state of the plant has one. A lookup gives ``lookup_steps`` steps, the next one
    begins where it ends (7.20); one alone gives the whole horizon if None. ``tabled``: whether what follows every node
    is put together once, which pays where many states are asked for.
    """

    trajectories: FloatArray
    nodes: Nodes
    frame: str
    projection: FloatArray
    modes: Modes
    lookup_steps: int | None = None
    tabled: bool = True

    kind = "futures"

    @property
    def functions(self) -> int:
        """Dimension N of the lifted state."""
        return len(self.modes)

    @property
    def horizon(self) -> int:
        """Steps that a lifted state holds."""
        return int(self.projection.shape[1]) - 1

    @property
    def ahead(self) -> int:
        """Steps that one lookup gives."""
        return self.horizon if self.lookup_steps is None else self.lookup_steps

    def future(self, x: FloatArray) -> FloatArray:
        """What follows the states ``x`` (n, n_x), interpolated: (n, horizon + 1, n_x). The first sample is x."""
        out = np.empty((len(x), self.horizon + 1, x.shape[1]))
        for start in range(0, len(x), TOGETHER):
            rows = slice(start, start + TOGETHER)
            out[rows, : self.ahead + 1] = self._looked_up(x[rows])
            for k in range(self.ahead, self.horizon, self.ahead):
                left = self.horizon - k
                out[rows, k + 1 : k + 1 + self.ahead] = self._looked_up(out[rows, k])[:, 1 : left + 1]
        return out

    def _looked_up(self, x: FloatArray) -> FloatArray:
        """What one lookup gives of what follows the states ``x`` (n, n_x), (n, ahead + 1, n_x)."""
        seen = self._combined(x).reshape(len(x), self.ahead + 1, x.shape[1])
        return FRAMES[self.frame].back(seen, x, self.modes.dt)

    def lift(self, x: FloatArray) -> FloatArray:
        """ψ(x) (n, N) of the states (n, n_x)."""
        blocks = np.matmul(self.projection, self.future(x))  # (n, L, n_x)
        return np.asarray(blocks.transpose(0, 2, 1).reshape(len(x), self.functions))

    def future_with_slopes(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The future of ``x`` (n, n_x), and its derivative in x, (n, horizon + 1, n_x, n_x), whose last axis is x's.

        By the weights of the splines with their nodes held fixed (7.22), and from one lookup to the next by the chain
        rule; values and derivatives are solved for together. Raises ``InvalidValueError`` for a lookup without a
        derivative.
        """
        n, n_x = x.shape
        out = np.empty((n, self.horizon + 1, n_x, 1 + n_x))
        for start in range(0, n, TOGETHER):
            rows = slice(start, start + TOGETHER)
            out[rows, : self.ahead + 1] = self._looked_up_with_slopes(x[rows])
            for k in range(self.ahead, self.horizon, self.ahead):
                left, on = self.horizon - k, slice(k + 1, k + 1 + self.ahead)
                after = self._looked_up_with_slopes(out[rows, k, :, 0])[:, 1 : left + 1]
                out[rows, on, :, 0] = after[..., 0]
                out[rows, on, :, 1:] = np.matmul(after[..., 1:], out[rows, k, np.newaxis, :, 1:])
        return out[..., 0], out[..., 1:]

    def _looked_up_with_slopes(self, x: FloatArray) -> FloatArray:
        """What one lookup gives, and beside each value its derivatives in ``x`` (n, n_x), (n, ahead + 1, n_x, 1 +
        n_x).
        """
        n, n_x = x.shape
        summed = self._summed(*self.nodes.find_slopes(x)).reshape(n, 1 + n_x, self.ahead + 1, n_x)
        return FRAMES[self.frame].back_with_slopes(summed.transpose(0, 2, 3, 1), x, self.modes.dt)

    def with_slopes(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """ψ(x) (n, N) of the states (n, n_x), and ∂ψ/∂x (n, N, n_x), for little more than ψ(x) alone (7.22)."""
        future, slopes = self.future_with_slopes(x)
        n, samples, n_x = future.shape
        blocks = np.matmul(self.projection, future).transpose(0, 2, 1)  # (n, n_x, L)
        turning = np.matmul(self.projection, slopes.reshape(n, samples, n_x * n_x)).reshape(
            n, len(self.projection), n_x, n_x
        )
        return blocks.reshape(n, self.functions), turning.transpose(0, 2, 1, 3).reshape(n, self.functions, n_x)

    def derivative(self, x: FloatArray) -> FloatArray:
        """∂ψ/∂x (n, N, n_x) at the states ``x`` (n, n_x), in units of ψ over those of x."""
        return self.with_slopes(x)[1]

    def future_derivative(self, x: FloatArray) -> FloatArray:
        """The derivative (n, horizon + 1, n_x, n_x) of the future of ``x`` (n, n_x) in x, which is the last axis."""
        return self.future_with_slopes(x)[1]

    def observe(self, x: FloatArray, rows: FloatArray) -> FloatArray:
        """rows · ψ(x) as (n, R), for ``rows`` (R, N)."""
        return self.lift(x) @ rows.T

    def onto(self, rows: FloatArray) -> Observed:
        """The function of ``x`` (n, n_x) that observes ``rows`` (R, N)."""
        return partial(self.observe, rows=rows)

    def _combined(self, x: FloatArray) -> FloatArray:
        """The weighted sums of the nodes' futures, (n, (ahead + 1) · n_x)."""
        from scipy.sparse import csr_matrix  # noqa: PLC0415  (what only reads a predictor goes without)

        indices, weights = self.nodes.find(x)
        if not self.tabled or self._table_bytes > LARGEST_TABLE:
            return self._gathered(indices, weights)
        if len(x) <= FEW:
            return np.asarray(np.matmul(weights[:, np.newaxis], self._values[indices])[:, 0])
        ends = np.arange(len(x) + 1) * indices.shape[1]
        table = csr_matrix((weights.ravel(), indices.ravel(), ends), shape=(len(x), len(self._values)))
        return np.asarray(table @ self._values)

    def _summed(self, indices: IndexArray, weights: FloatArray, slopes: FloatArray) -> FloatArray:
        """The weighted sums of the nodes' futures, and those by the ``slopes`` (n, q, n_x) of the weights, (n, 1 + n_x,
        (ahead + 1) · n_x).
        """
        tabled = self.tabled and self._table_bytes <= LARGEST_TABLE
        rows = np.concatenate([weights[:, np.newaxis], slopes.transpose(0, 2, 1)], axis=1)
        summed = np.empty((*rows.shape[:2], self._width))
        for start in range(0, len(indices), GATHERED):
            some = slice(start, start + GATHERED)
            nodes = indices[some]
            values = self._values[nodes] if tabled else self._values_of(nodes.ravel())
            summed[some] = np.matmul(rows[some], values.reshape(*nodes.shape, self._width))
        return summed

    def _gathered(self, indices: IndexArray, weights: FloatArray) -> FloatArray:
        """The same without a table of all nodes: what follows those that are found."""
        gathered = np.empty((len(indices), self._width))
        for start in range(0, len(indices), GATHERED):
            rows = slice(start, start + GATHERED)
            values = self._values_of(indices[rows].ravel()).reshape(*indices[rows].shape, -1)
            gathered[rows] = np.matmul(weights[rows, np.newaxis], values)[:, 0]
        return gathered

    @property
    def _width(self) -> int:
        """Numbers that follow a node."""
        return (self.ahead + 1) * int(self.trajectories.shape[2])

    @property
    def _table_bytes(self) -> float:
        return 8.0 * len(self.nodes.kept) * self._width

    @cached_property
    def _values(self) -> FloatArray:
        """What follows every node, in the frame, (nodes, (ahead + 1) · n_x)."""
        return self._values_of(np.arange(len(self.nodes.kept)))

    def _values_of(self, nodes: IndexArray) -> FloatArray:
        """What follows some ``nodes`` (m,), (m, (ahead + 1) · n_x)."""
        j, k = self.nodes.trajectory[nodes], self.nodes.sample[nodes]
        ahead = self.trajectories[j[:, np.newaxis], k[:, np.newaxis] + np.arange(self.ahead + 1)]
        return np.asarray(FRAMES[self.frame].seen(ahead, self.modes.dt).reshape(len(j), -1))

    def pack(self) -> Packed:
        """Trajectories, nodes and projection."""
        nodes = self.nodes.pack()
        arrays = {
            "trajectories": Array(self.trajectories, ("trajectory", "sample", "state"), OF_STATES),
            "projection": Array(self.projection, ("state_of_block", "sample_ahead"), "1"),
            **nodes.arrays,
        }
        meta: Meta = {"kind": self.kind, "frame": self.frame, "search": nodes.meta}
        return Packed(arrays, meta if self.lookup_steps is None else {**meta, "lookup_steps": self.lookup_steps})

    @classmethod
    def unpack(cls, packed: Packed, modes: Modes) -> Futures:
        """The inverse of :meth:`pack`."""
        trajectories = packed.arrays["trajectories"].values[...]
        nodes = Nodes.unpack(Packed(packed.arrays, packed.meta["search"]), trajectories)
        projection, meta = packed.arrays["projection"].values[...], packed.meta
        return cls(trajectories, nodes, meta["frame"], projection, modes, meta.get("lookup_steps"))
