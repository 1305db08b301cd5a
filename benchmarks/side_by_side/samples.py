"""The samples of one dataset and koop's basis for them, read back with numpy alone so that every environment can."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

ARRAYS = "arrays.npz"
BLOCK = 4096  # rows lifted together, so that the factors stay in the cache


@dataclass
class TensorBasis:
    """Products of one orthonormal polynomial of each state, the last state's degree fastest.

    ``maps``: (centre, scale) of each state; ``alphas`` (k,) and ``betas`` (k + 1,): the recurrences; ``C`` (n_x, N)
    with x = C ψ(x). ``seconds``: CPU time spent lifting so far.
    """

    maps: list[np.ndarray]
    alphas: list[np.ndarray]
    betas: list[np.ndarray]
    C: np.ndarray
    seconds: float = field(default=0.0)

    def __call__(self, x: np.ndarray, u: np.ndarray | None = None) -> np.ndarray:
        """ψ(x), or [ψ(x), u], (n, N) or (n, N + n_u) of the states ``x`` (n, n_x), columns contiguous."""
        begin = time.process_time()
        functions, n_u = self.C.shape[1], 0 if u is None else u.shape[1]
        columns = np.empty((functions + n_u, len(x)))
        for start in range(0, len(x), BLOCK):
            rows = slice(start, min(start + BLOCK, len(x)))
            head, *others = (self._axis(i, x[rows, i]) for i in range(x.shape[1]))
            for factor in others[:-1]:
                head = (head[:, np.newaxis] * factor).reshape(-1, head.shape[1])
            last = others[-1]
            into = columns[:functions, rows].reshape(len(head), len(last), -1)
            np.multiply(head[:, np.newaxis], last, out=into)
        if u is not None:
            columns[functions:] = u.T
        self.seconds += time.process_time() - begin
        return columns.T

    def _axis(self, i: int, t: np.ndarray) -> np.ndarray:
        """Values (degree + 1, n) of the polynomials of state ``i``."""
        (centre, scale), alpha, beta = self.maps[i], self.alphas[i], self.betas[i]
        s = (t - centre) / scale
        p = np.ones((len(beta), len(t)))
        for j in range(len(alpha)):
            p[j + 1] = ((s - alpha[j]) * p[j] - (beta[j] * p[j - 1] if j else 0.0)) / beta[j + 1]
        return p


@dataclass
class Samples:
    """One-step pairs ``x`` (n, n_x), ``u`` (n, n_u), ``x_next``; a test set ``test_x`` (m, steps + 1, n_x), ``test_u``
    (m, steps, n_u); and the basis. ``folder`` is where koop's own copy lies.
    """

    folder: Path
    x: np.ndarray
    u: np.ndarray
    x_next: np.ndarray
    test_x: np.ndarray
    test_u: np.ndarray
    dt: float
    basis: TensorBasis

    @classmethod
    def read(cls, folder: Path) -> Samples:
        """What the driver has written there."""
        with np.load(folder / ARRAYS) as file:
            held = {name: file[name] for name in file.files}
        n_x = held["x"].shape[1]
        recurrences = ([held.pop(f"{name}{i}") for i in range(n_x)] for name in ("map", "alpha", "beta"))
        basis = TensorBasis(*recurrences, C=held.pop("C"))
        return cls(folder, dt=float(held.pop("dt")), basis=basis, **held)
