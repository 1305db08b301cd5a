"""Eigenfunctions known at the samples of trajectories, and looked up for any other state (docs/equations.md 7)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from koopcli.koopman.lifts import Observed
from koopcli.koopman.modes import IndexArray, Modes
from koopcli.records import Array, FloatArray, Packed


@dataclass(frozen=True)
class Nearest:
    """ψ(x) = ψ of the nearest tabulated sample, in raw SI units (7.6).

    ``states`` (J, K, n_x): the samples k = 0..K-1 of J trajectories; ``starts`` (J, copies, L): the lifted states of
    their initial states, or (J, copies, 1) where only the first state of a block is set; ``modes`` carries them on.
    """

    states: FloatArray
    starts: FloatArray
    modes: Modes

    kind = "nearest"

    @property
    def functions(self) -> int:
        """Dimension N of the lifted state."""
        return len(self.modes)

    def lift(self, x: FloatArray) -> FloatArray:
        """ψ(x) (n, N) of the states (n, n_x)."""
        j, k = self.nearest(x)
        driving = self._powers[k][:, :, : self.starts.shape[2]]
        return np.asarray(np.matmul(self.starts[j], driving.transpose(0, 2, 1))).reshape(len(x), self.functions)

    def observe(self, x: FloatArray, rows: FloatArray) -> FloatArray:
        """rows · ψ(x) as (n, R), for ``rows`` (R, N); ψ itself is only formed where it is small."""
        if self.starts.shape[2] == len(self.modes.rates):
            return self.lift(x) @ rows.T
        j, k = self.nearest(x)
        copies, L = self.modes.copies, len(self.modes.rates)
        by_copy = rows.reshape(len(rows), copies, L).transpose(1, 0, 2).reshape(copies, -1)
        used, position = np.unique(j, return_inverse=True)
        there = (self.starts[used, :, 0] @ by_copy).reshape(len(used), len(rows), L)
        return np.asarray(np.matmul(there[position], self._powers[k][:, :, :1])[:, :, 0])

    def onto(self, rows: FloatArray) -> Observed:
        """The function of ``x`` (n, n_x) that looks rows · ψ up, tabulated at every sample, for few ``rows`` (R, N)."""
        J, K, L = len(self.states), self.states.shape[1], len(self.modes.rates)
        by_copy = rows.reshape(len(rows), self.modes.copies, L)
        if self.starts.shape[2] == L:
            carried = np.tensordot(by_copy, self._powers, axes=(2, 1))  # (R, copies, K, L)
            table = np.tensordot(self.starts, carried, axes=([1, 2], [1, 3])).transpose(0, 2, 1)
        else:
            there = np.tensordot(self.starts[:, :, 0], by_copy, axes=(1, 1))  # (J, R, L)
            table = np.tensordot(there, self._powers[:, :, 0], axes=(2, 1)).transpose(0, 2, 1)
        assert table.shape == (J, K, len(rows))

        def look_up(x: FloatArray) -> FloatArray:
            return np.asarray(table[self.nearest(x)])

        return look_up

    def nearest(self, x: FloatArray) -> tuple[IndexArray, IndexArray]:
        """Trajectory and sample (n,) of the tabulated state nearest to each of ``x`` (n, n_x).

        A state that is not finite, as a diverged prediction has, meets the first one.
        """
        finite = np.isfinite(x).all(axis=1)
        found = np.zeros(len(x), dtype=np.intp)
        found[finite] = self._tree.query(x[finite])[1]
        j, k = np.divmod(found, self.states.shape[1])
        return j, k

    def pack(self) -> Packed:
        """The table."""
        arrays = {
            "states": Array(self.states, ("trajectory", "sample", "state"), "those of the state"),
            "starts": Array(self.starts, ("trajectory", "copy", "state of a block"), "1"),
        }
        return Packed(arrays, {"kind": self.kind})

    @classmethod
    def unpack(cls, packed: Packed, modes: Modes) -> Nearest:
        """The inverse of :meth:`pack`."""
        return cls(packed.arrays["states"].values[...], packed.arrays["starts"].values[...], modes)

    @cached_property
    def _powers(self) -> FloatArray:
        """The block of A after 0 .. K-1 steps, (K, L, L)."""
        return self.modes.powers(self.states.shape[1] - 1)

    @cached_property
    def _tree(self) -> Any:
        from scipy.spatial import cKDTree  # noqa: PLC0415  (what only reads a predictor goes without)

        return cKDTree(self.states.reshape(-1, self.states.shape[2]))
