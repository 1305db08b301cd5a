"""PyKoopman: `Koopman` with its `EDMDc` regressor."""

from __future__ import annotations

import numpy as np
from competitor import Competitor
from pykoopman import Koopman
from pykoopman.observables import Identity
from pykoopman.regression import EDMDc


class Lifted(Identity):
    """Rows that are lifted already, and the exact way back to the states."""

    def __init__(self, C: np.ndarray | None = None) -> None:
        super().__init__()
        self.C = C

    def fit(self, x: np.ndarray, y: np.ndarray | None = None) -> Lifted:
        super().fit(x, y)
        self.measurement_matrix_ = self.C
        return self


class PyKoopman(Competitor):
    how = (
        "`Koopman(observables, EDMDc())`, observables a subclass of `Identity` on lifted rows that knows C; "
        "`Koopman.simulate`, one trajectory at a time"
    )
    packages = ("pykoopman", "numpy", "scipy", "scikit-learn")
    alone = True

    def fit(self) -> None:
        V, Y = self.rows
        N = Y.shape[1]
        self.model = Koopman(Lifted(self.samples.basis.C), EDMDc())
        self.model.fit(V[:, :N], Y, u=V[:, N:], dt=self.samples.dt)

    def predict(self, x0: np.ndarray, u: np.ndarray) -> np.ndarray:
        z0 = self.samples.basis(x0)
        ahead = [self.model.simulate(start, inputs, n_steps=len(inputs)) for start, inputs in zip(z0, u)]  # noqa: B905
        return np.concatenate([x0[:, np.newaxis], ahead], axis=1)

    def operator(self) -> tuple[np.ndarray, np.ndarray]:
        return self.model.A, self.model.B
