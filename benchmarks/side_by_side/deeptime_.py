"""deeptime: its `EDMD` estimator, and its `Covariance`, which takes chunks; the inputs are further observables."""

from __future__ import annotations

import numpy as np
from competitor import Competitor, rolled
from deeptime.basis import Identity
from deeptime.covariance import Covariance
from deeptime.decomposition import EDMD, TransferOperatorModel
from deeptime.numeric import spd_inv
from samples import BLOCK


class Deeptime(Competitor):
    how = (
        "`EDMD(Identity())` on lifted rows; it knows no inputs, so [ψ(x), u] goes to [ψ(x⁺), 0]; "
        "`forward` of its model step by step, all trajectories together"
    )
    packages = ("deeptime", "numpy", "scipy")

    def lift(self) -> None:
        s = self.samples
        self.rows = s.basis(s.x, s.u), s.basis(s.x_next, np.zeros_like(s.u))

    def fit(self) -> None:
        self.model = EDMD(Identity()).fit(self.rows).fetch_model()

    def predict(self, x0: np.ndarray, u: np.ndarray) -> np.ndarray:
        basis = self.samples.basis
        N = basis.C.shape[1]
        return rolled(lambda z, now: self.model.forward(np.hstack([z, now]))[:, :N], basis(x0), u, basis.C)

    def operator(self) -> tuple[np.ndarray, np.ndarray]:
        N = self.samples.basis.C.shape[1]
        found = self.model.operator.T[:N]
        return found[:, :N], found[:, N:]


class Streamed(Deeptime):
    how = (
        "`Covariance.partial_fit` on chunks of 4 096 rows lifted as they are needed, its `spd_inv` and "
        "`TransferOperatorModel` put together by hand; its `forward` as above"
    )

    def lift(self) -> None:
        """Nothing: each chunk is lifted on its own."""

    def fit(self) -> None:
        s, moments = self.samples, Covariance(lagtime=1, compute_c0t=True, bessels_correction=False)
        for start in range(0, len(s.x), BLOCK):
            rows = slice(start, start + BLOCK)
            pair = s.basis(s.x[rows], s.u[rows]), s.basis(s.x_next[rows])
            moments.partial_fit(tuple(np.ascontiguousarray(part) for part in pair))  # which it is faster on
        found = moments.fetch_model()
        self.model = TransferOperatorModel(spd_inv(found.cov_00) @ found.cov_0t)
