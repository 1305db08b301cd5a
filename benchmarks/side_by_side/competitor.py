"""What every competitor does, in one shape: lift all rows, fit, predict."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np
from samples import Samples


class Competitor(ABC):
    """``how`` says which estimator and options, for the notes; ``packages`` whose versions are told; ``alone`` whether
    its own call predicts one trajectory at a time.
    """

    how: str
    packages: tuple[str, ...] = ("numpy",)
    alone = False
    rows: Any = None  # what `lift` leaves for `fit`

    def __init__(self, samples: Samples) -> None:
        """Whatever lies ready before the clock starts."""
        self.samples = samples

    def lift(self) -> None:
        """Lift all rows the way the fit needs them."""
        s = self.samples
        self.rows = s.basis(s.x, s.u), s.basis(s.x_next)

    @abstractmethod
    def fit(self) -> None:
        """The fit alone, from what `lift` has left."""

    @abstractmethod
    def predict(self, x0: np.ndarray, u: np.ndarray) -> np.ndarray:
        """States (m, steps + 1, n_x) from ``x0`` (m, n_x) under ``u`` (m, steps, n_u), by its own call."""

    @abstractmethod
    def operator(self) -> tuple[np.ndarray, np.ndarray]:
        """A (N, N) and B (N, n_u) as it found them."""


def rolled(step: Any, z: np.ndarray, u: np.ndarray, C: np.ndarray) -> np.ndarray:
    """States by ``step(z, u)`` from one lifted sample to the next, all trajectories together."""
    x = np.empty((len(z), u.shape[1] + 1, len(C)))
    x[:, 0] = z @ C.T
    for k in range(u.shape[1]):
        z = step(z, u[:, k])
        x[:, k + 1] = z @ C.T
    return x
