"""Plain numpy: the chunked normal equations of ``benchmarks/plain.py``."""

from __future__ import annotations

import numpy as np
import plain
from competitor import Competitor, rolled


class Gram(Competitor):
    how = "normal equations summed over chunks of 4 096 rows lifted as they are needed, `numpy.linalg.solve`"

    def lift(self) -> None:
        """Nothing: each chunk is lifted on its own."""

    def fit(self) -> None:
        s = self.samples
        self.A, self.B = plain.fit(s.x, s.u, s.x_next, s.basis)

    def predict(self, x0: np.ndarray, u: np.ndarray) -> np.ndarray:
        basis = self.samples.basis
        return rolled(lambda z, now: z @ self.A.T + now @ self.B.T, basis(x0), u, basis.C)

    def operator(self) -> tuple[np.ndarray, np.ndarray]:
        return self.A, self.B
