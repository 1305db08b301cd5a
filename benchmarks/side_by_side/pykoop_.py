"""pykoop: its `Edmd` regressor."""

from __future__ import annotations

import numpy as np
import pykoop
from competitor import Competitor


class Pykoop(Competitor):
    how = (
        "`Edmd()` on pairs of lifted rows, which spares `KoopmanPipeline` its 202 500 episodes; "
        "`KoopmanPipeline.predict_trajectory(relift_state=False)` on lifted states without validation, one trajectory "
        "at a time, which is faster than its episodes"
    )
    packages = ("pykoop", "numpy", "scipy", "scikit-learn")
    alone = True

    def fit(self) -> None:
        V, Y = self.rows
        self.pipeline = pykoop.KoopmanPipeline(regressor=pykoop.Edmd())
        self.pipeline.fit_transformers(V[:2], n_inputs=V.shape[1] - Y.shape[1])
        self.pipeline.regressor_ = pykoop.Edmd().fit(V, Y, n_inputs=V.shape[1] - Y.shape[1])
        self.pipeline.regressor_fit_ = True

    def predict(self, x0: np.ndarray, u: np.ndarray) -> np.ndarray:
        basis = self.samples.basis
        ends = np.concatenate([u, np.zeros_like(u[:, :1])], axis=1)  # it predicts as many samples as there are inputs
        with pykoop.config_context(skip_validation=True):
            z = [
                self.pipeline.predict_trajectory(start[np.newaxis], inputs, relift_state=False)
                for start, inputs in zip(basis(x0), ends)  # noqa: B905
            ]
        return np.stack(z) @ basis.C.T

    def operator(self) -> tuple[np.ndarray, np.ndarray]:
        found = self.pipeline.regressor_.coef_.T
        return found[:, : len(found)], found[:, len(found) :]
