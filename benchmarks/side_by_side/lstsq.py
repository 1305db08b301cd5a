"""Plain numpy: least squares on all rows at once."""

from __future__ import annotations

import numpy as np
from gram import Gram


class Lstsq(Gram):
    how = "`numpy.linalg.lstsq(…, rcond=None)` on all rows"

    def lift(self) -> None:
        s = self.samples
        self.rows = s.basis(s.x, s.u), s.basis(s.x_next)

    def fit(self) -> None:
        V, Y = self.rows
        W, _, rank, _ = np.linalg.lstsq(V, Y, rcond=None)
        assert rank == V.shape[1], f"rank {rank} of {V.shape[1]}"
        N = Y.shape[1]
        self.A, self.B = W[:N].T, W[N:].T
