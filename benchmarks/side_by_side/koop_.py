"""koop: basis and fit by its public calls, on the dataset as its store holds it."""

from __future__ import annotations

import numpy as np
import scipy.linalg
import scipy.spatial  # noqa: F401  (imports aside)
from competitor import Competitor
from samples import Samples

import koopcli
from koopcli.koopman.edmd import fit as edmd
from koopcli.koopman.edmd.passes import here
from koopcli.koopman.edmd.survey import survey
from koopcli.koopman.edmd.transitions import Transitions


class Koop(Competitor):
    how = (
        "`survey`, `basis_from_data` and `fit` on the stored samples as `koop fit-edmd` does, lifting inside; `predict`"
    )
    packages = ("koopcli", "numpy", "scipy")

    def __init__(self, samples: Samples) -> None:
        super().__init__(samples)
        self.data = koopcli.load("simulate", samples.folder / "store")

    def lift(self) -> None:
        """Nothing: the fit lifts."""

    def fit(self) -> None:
        pairs = Transitions.of(self.data)
        seen = survey(pairs, here(pairs))
        self.predictor = edmd.fit(pairs, edmd.FitEdmd.of(basis="tensor", order=7).basis_from(pairs, seen), seen=seen)

    def predict(self, x0: np.ndarray, u: np.ndarray) -> np.ndarray:
        return self.predictor.predict(x0, u)

    def operator(self) -> tuple[np.ndarray, np.ndarray]:
        return self.predictor.A, self.predictor.B
