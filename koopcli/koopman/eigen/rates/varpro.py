"""The rates that hold the data best, by variable projection."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from koopcli.choices import setting
from koopcli.koopman.eigen.rates.comb import Comb
from koopcli.koopman.eigen.rates.rates import Windows
from koopcli.koopman.predictor.modes import ComplexArray, exponentials
from koopcli.records import FloatArray

INDEPENDENT = 1e-8  # smallest singular value of the exponentials, of the largest, that the search counts
SLOWEST, FASTEST = -12.0, 1.0  # of the search: real parts in 1/s
LOWEST, HIGHEST = 0.05, 60.0  # and frequencies in rad/s
ROUNDS = 300


@dataclass(frozen=True)
class Varpro(Comb):
    """The best rates for the data, by variable projection, from a comb."""

    kind: ClassVar[str] = "varpro"
    pairs: int = setting(6, low=1, high=1000, option=True, help="pairs of complex rates, beside two real ones")

    def find(self, x: FloatArray, windows: Windows, dt: float) -> ComplexArray:
        """Those of the ``windows``."""
        return searched(windows, dt, self)


def searched(x: Windows, dt: float, comb: Comb) -> ComplexArray:
    """The rates, as many as those of the ``comb``, whose exponentials hold the windows ``x`` best, eq. (7.11).

    Variable projection: the coefficients are eliminated, and the logarithm of what is left is followed downhill with
    its exact gradient.
    """
    from scipy.optimize import minimize  # noqa: PLC0415  (only this one needs it)

    start = comb.even
    count = comb.pairs
    pairs, single = start[: 2 * count : 2], start[2 * count :]
    gram = _gram(x)
    t: FloatArray = dt * np.arange(float(len(gram)))

    def left(values: FloatArray) -> tuple[float, FloatArray]:
        rates = _assembled(values, count)
        residual, slope = projected_residual(gram, rates, t)
        gradient = np.empty_like(values)
        gradient[:count] = slope.real[: 2 * count : 2]
        gradient[count : 2 * count] = slope.imag[: 2 * count : 2]
        gradient[2 * count :] = slope.real[2 * count :]
        return math.log(residual), gradient / residual

    optimum = minimize(
        left,
        np.concatenate([pairs.real, pairs.imag, single.real]),
        jac=True,
        method="L-BFGS-B",
        bounds=[(SLOWEST, FASTEST)] * count + [(LOWEST, HIGHEST)] * count + [(SLOWEST, FASTEST)] * len(single),
        options={"maxiter": ROUNDS},
    )
    return _assembled(optimum.x, count)


def _assembled(values: FloatArray, pairs: int) -> ComplexArray:
    """Complex rates from the real parts and frequencies of pairs, then real rates."""
    upper = values[:pairs] + 1j * values[pairs : 2 * pairs]
    both = np.stack([upper, upper.conj()], axis=1).ravel()
    return np.concatenate([both, values[2 * pairs :]])


def _gram(x: Windows) -> FloatArray:
    """Σ x xᵀ over all windows and states, (samples, samples), of trace one."""
    gram = np.zeros((x[0].shape[1],) * 2)
    for some in x:
        columns = some.transpose(1, 0, 2).reshape(some.shape[1], -1)
        gram += columns @ columns.T
    return gram / max(float(np.trace(gram)), np.finfo(float).tiny)


def projected_residual(gram: FloatArray, rates: ComplexArray, t: FloatArray) -> tuple[float, ComplexArray]:
    """tr((1 - P) G), P the projection on the exponentials of ``rates`` at times ``t``, G a ``gram`` of trace one.

    With its derivative by the real parts of the rates (real) and by the frequencies of the first of each pair
    (imaginary).
    """
    V = exponentials(rates, t)
    length = np.linalg.norm(V, axis=0)
    left, singular, right = np.linalg.svd(V / length, full_matrices=False)
    keep = singular > INDEPENDENT * singular[0]
    left, singular, right = left[:, keep], singular[keep], right[keep]
    missed = gram - left @ (left.T @ gram)
    residual = max(float(np.trace(missed)), np.finfo(float).eps)
    pseudo = (right.T / singular) @ left.T / length[:, np.newaxis]  # (modes, samples)
    slope = -2 * missed @ pseudo.T  # of the residual by V
    by_real = (slope * t[:, np.newaxis] * V).sum(axis=0)
    by_frequency = np.zeros(len(rates))
    first = np.flatnonzero(rates.imag > 0)
    cosine, sine = V[:, first], V[:, first + 1]
    by_frequency[first] = (t[:, np.newaxis] * (slope[:, first + 1] * cosine - slope[:, first] * sine)).sum(axis=0)
    by_real[first] += by_real[first + 1]
    return residual, by_real + 1j * by_frequency
