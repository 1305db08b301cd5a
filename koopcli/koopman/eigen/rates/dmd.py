"""Rates from the data's best linear map, and their sums."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import product
from typing import ClassVar

import numpy as np

from koopcli.choices import setting
from koopcli.errors import InvalidValueError
from koopcli.koopman.eigen.rates.rates import Rates, Windows
from koopcli.koopman.predictor.modes import ComplexArray
from koopcli.records import FloatArray

SAME = 1e-9  # relative distance below which two rates are one


@dataclass(frozen=True)
class Dmd(Rates):
    """Sums of the data's own rates, as in the paper."""

    kind: ClassVar[str] = "dmd"
    degree: int = setting(
        2,
        low=0,
        high=100,
        option=True,
        help="rates are sums of up to this many of the data's three: 1, 2, 3 give 4, 10, 20 of them",
    )

    def count(self, states: int) -> int:
        """How many sums there are, zero included."""
        return math.comb(states + self.degree, self.degree)

    def find(self, x: FloatArray, windows: Windows, dt: float) -> ComplexArray:
        """The lattice (7.4) of the rates (7.3) of ``x`` (J, samples, n_x)."""
        return lattice(dmd_rates(x, dt), self.degree)


def dmd_rates(x: FloatArray, dt: float) -> ComplexArray:
    """The rates log(eig)/dt in 1/s of the best linear map x_k → x_{k+1} over ``x`` (J, samples, n_x), eq. (7.3).

    Raises ``InvalidValueError`` where an eigenvalue is zero or negative and so has no rate.
    """
    n_x = x.shape[2]
    now, then = x[:, :-1].reshape(-1, n_x), x[:, 1:].reshape(-1, n_x)
    eigenvalues = np.linalg.eigvals(np.linalg.lstsq(now, then, rcond=None)[0].T).astype(complex)
    for value in eigenvalues:
        if value.imag == 0 and value.real <= 0:
            raise InvalidValueError(
                f"the best linear map of these trajectories has the eigenvalue {value.real:.3g}, which no continuous "
                "rate has: give trajectories that move in every state, or sample faster (a smaller simulate.dt)"
            )
    return np.asarray(np.log(eigenvalues) / dt)


def lattice(rates: ComplexArray, degree: int) -> ComplexArray:
    """All sums Σ p_i λ_i with whole p_i ≥ 0 and Σ p_i ≤ ``degree``, equal ones once, by rising degree, eq. (7.4).

    A complex rate is followed by its conjugate.
    """
    powers = [p for p in product(range(degree + 1), repeat=len(rates)) if sum(p) <= degree]
    powers.sort(key=lambda p: (sum(p), [-n for n in p]))
    kept: list[complex] = []
    for p in powers:
        rate = complex(np.dot(p, rates))
        if abs(rate.imag) <= SAME * (1 + abs(rate)):
            rate = complex(rate.real)
        if rate.imag >= 0 and all(abs(rate - earlier) > SAME * (1 + abs(rate)) for earlier in kept):
            kept.append(rate)
    return np.array([value for rate in kept for value in ((rate,) if rate.imag == 0 else (rate, rate.conjugate()))])
