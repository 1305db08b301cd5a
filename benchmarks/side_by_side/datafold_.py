"""datafold: its `DMDControl` on time series of lifted states."""

from __future__ import annotations

import numpy as np
from competitor import Competitor
from datafold.dynfold import DMDControl
from datafold.pcfold import InitialCondition, TSCDataFrame


class Datafold(Competitor):
    how = (
        "`DMDControl(sys_mode='matrix')` on a `TSCDataFrame` of lifted states, which counts as lifting; "
        "`DMDControl.predict`, all trajectories together"
    )
    packages = ("datafold", "numpy", "scipy", "pandas")

    def lift(self) -> None:
        s = self.samples
        X = TSCDataFrame.from_shift_matrices(
            s.basis(s.x), s.basis(s.x_next), time_values=(0.0, s.dt), snapshot_orientation="row"
        )
        self.rows = X, self._inputs(s.u[:, np.newaxis], X.ids)

    def fit(self) -> None:
        X, U = self.rows
        self.model = DMDControl(sys_mode="matrix").fit(X, U=U)

    def predict(self, x0: np.ndarray, u: np.ndarray) -> np.ndarray:
        basis = self.samples.basis
        U = self._inputs(u, np.arange(len(x0)))
        start = InitialCondition.from_array(basis(x0), 0.0, feature_names=self.model.feature_names_in_, ts_ids=U.ids)
        z = self.model.predict(start, U=U).to_numpy()
        return (z @ basis.C.T).reshape(len(x0), -1, len(basis.C))

    def _inputs(self, u: np.ndarray, ids: np.ndarray) -> TSCDataFrame:
        names = [f"u{i}" for i in range(u.shape[2])]
        times = self.samples.dt * np.arange(u.shape[1])
        return TSCDataFrame.from_tensor(u, np.asarray(ids), names, times)

    def operator(self) -> tuple[np.ndarray, np.ndarray]:
        return self.model.sys_matrix_, self.model.control_matrix_
