"""Eigenfunctions known at the samples of trajectories, and looked up for any other state (docs/equations.md 7)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from koopcli.content import Content
from koopcli.koopman.eigen.nodes import Nodes
from koopcli.koopman.predictor.lifts import Observed
from koopcli.koopman.predictor.modes import Modes
from koopcli.records import OF_STATES, Array, FloatArray, IndexArray, Packed


@dataclass(frozen=True, eq=False, repr=False)
class Tabulated(Content):
    """ψ(x) = Σ weights · ψ of samples near x, which have theirs from the initial states of their trajectories (7.6).

    ``states`` (J, K, n_x): the samples k = 0..K-1 of J trajectories, ``nodes`` those of them that are looked up;
    ``starts`` (J, copies, L): the lifted states of the initial states, or (J, copies, 1) where only the first state of
    a block is set; ``modes`` carries them on.
    """

    states: FloatArray
    nodes: Nodes
    starts: FloatArray
    modes: Modes

    kind = "tabulated"

    @property
    def functions(self) -> int:
        """Dimension N of the lifted state."""
        return len(self.modes)

    def lift(self, x: FloatArray) -> FloatArray:
        """ψ(x) (n, N) of the states (n, n_x)."""
        total = np.zeros((len(x), self.functions))
        for j, k, weight in self._found(x):
            driving = self._powers[k][:, :, : self.starts.shape[2]]
            lifted = np.matmul(self.starts[j], driving.transpose(0, 2, 1)).reshape(len(x), self.functions)
            total += weight[:, np.newaxis] * lifted
        return total

    def observe(self, x: FloatArray, rows: FloatArray) -> FloatArray:
        """rows · ψ(x) as (n, R), for ``rows`` (R, N); ψ itself is only formed where it is small."""
        if self.starts.shape[2] == len(self.modes.rates):
            return self.lift(x) @ rows.T
        copies, L = self.modes.copies, len(self.modes.rates)
        by_copy = rows.reshape(len(rows), copies, L).transpose(1, 0, 2).reshape(copies, -1)
        total = np.zeros((len(x), len(rows)))
        for j, k, weight in self._found(x):
            used, position = np.unique(j, return_inverse=True)
            projected = (self.starts[used, :, 0] @ by_copy).reshape(len(used), len(rows), L)
            seen = np.matmul(projected[position], self._powers[k][:, :, :1])[:, :, 0]
            total += weight[:, np.newaxis] * seen
        return total

    def onto(self, rows: FloatArray) -> Observed:
        """The function of ``x`` (n, n_x) that looks rows · ψ up, tabulated at every sample, for few ``rows`` (R, N)."""
        J, K, L = len(self.states), self.states.shape[1], len(self.modes.rates)
        by_copy = rows.reshape(len(rows), self.modes.copies, L)
        if self.starts.shape[2] == L:
            carried = np.tensordot(by_copy, self._powers, axes=(2, 1))  # (R, copies, K, L)
            table = np.tensordot(self.starts, carried, axes=([1, 2], [1, 3])).transpose(0, 2, 1)
        else:
            projected = np.tensordot(self.starts[:, :, 0], by_copy, axes=(1, 1))  # (J, R, L)
            table = np.tensordot(projected, self._powers[:, :, 0], axes=(2, 1)).transpose(0, 2, 1)
        assert table.shape == (J, K, len(rows))

        def look_up(x: FloatArray) -> FloatArray:
            total = np.zeros((len(x), len(rows)))
            for j, k, weight in self._found(x):
                total += weight[:, np.newaxis] * table[j, k]
            return total

        return look_up

    def _found(self, x: FloatArray) -> list[tuple[IndexArray, IndexArray, FloatArray]]:
        """Trajectory, sample and weight (n,) of the first, second, ... node of each of ``x`` (n, n_x)."""
        indices, weights = self.nodes.find(x)
        j, k = np.divmod(self.nodes.kept[indices], self.states.shape[1])
        return [(j[:, q], k[:, q], weights[:, q]) for q in range(indices.shape[1])]

    @cached_property
    def _powers(self) -> FloatArray:
        """The block of A after 0 .. K-1 steps, (K, L, L)."""
        return self.modes.powers(self.states.shape[1] - 1)

    def pack(self) -> Packed:
        """The table."""
        nodes = self.nodes.pack()
        arrays = {
            "states": Array(self.states, ("trajectory", "sample", "state"), OF_STATES),
            "starts": Array(self.starts, ("trajectory", "copy", "state_of_block"), "1"),
            **nodes.arrays,
        }
        return Packed(arrays, {"kind": self.kind, "search": nodes.meta})

    @classmethod
    def unpack(cls, packed: Packed, modes: Modes) -> Tabulated:
        """The inverse of :meth:`pack`."""
        states = packed.arrays["states"].values[...]
        nodes = Nodes.unpack(Packed(packed.arrays, packed.meta["search"]), states)
        return cls(states, nodes, packed.arrays["starts"].values[...], modes)
