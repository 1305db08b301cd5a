"""koop: basis and fit by its public calls, on the dataset as its store holds it."""

from __future__ import annotations

import numpy as np
import scipy.linalg
import scipy.spatial  # noqa: F401  (imports aside)
from competitor import Competitor
from samples import Samples

import koopcli
from koopcli.koopman import edmd
from koopcli.koopman.bases import Choice


class Koop(Competitor):
    how = "`edmd.basis_from_data` and `edmd.fit` on the stored samples, lifting inside; `Predictor.predict`"
    packages = ("koopcli", "numpy", "scipy")

    def __init__(self, samples: Samples) -> None:
        super().__init__(samples)
        self.data = koopcli.load("simulate", samples.folder / "store")

    def lift(self) -> None:
        """Nothing: the fit lifts."""

    def fit(self) -> None:
        self.predictor = edmd.fit(self.data, edmd.basis_from_data(self.data, Choice("tensor", 7)))

    def predict(self, x0: np.ndarray, u: np.ndarray) -> np.ndarray:
        return self.predictor.predict(x0, u)

    def operator(self) -> tuple[np.ndarray, np.ndarray]:
        return self.predictor.A, self.predictor.B
