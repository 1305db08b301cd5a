"""Where the rates of growth of eigenfunctions come from: the data's linear map, a comb, or a search (equations 7)."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.koopman.predictor.modes import ComplexArray, exponentials
from koopcli.records import FloatArray

LARGEST_EXPONENT = 230.0  # e^230 = 1e100: products of a few such numbers are still finite
SAME = 1e-9  # relative distance below which two rates are one
INDEPENDENT = 1e-8  # smallest singular value of the exponentials, of the largest, that the search counts
SLOWEST, FASTEST = -12.0, 1.0  # of the search: real parts in 1/s
LOWEST, HIGHEST = 0.05, 60.0  # and frequencies in rad/s
ROUNDS = 300


@dataclass(frozen=True)
class Spectrum:
    """What rates are asked for: ``kind`` of ``RATES``; sums of up to ``degree`` of the data's own (``dmd``), or
    ``pairs`` of frequencies evenly from ``low`` to ``high`` rad/s at one ``damping`` in 1/s, beside 0 and -damping
    (``comb``, and where the search of ``varpro`` starts).
    """

    kind: str
    degree: int
    pairs: int
    low: float
    high: float
    damping: float

    def count(self, states: int) -> int:
        """How many real modes they have."""
        return lattice_size(states, self.degree) if self.kind == "dmd" else 2 * self.pairs + 2


Windows = Sequence[FloatArray]  # (J, samples, n_x) each, of one length


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


def lattice_size(states: int, degree: int) -> int:
    """How many sums of up to ``degree`` rates there are, zero included."""
    return math.comb(states + degree, degree)


def lattice(rates: ComplexArray, degree: int) -> ComplexArray:
    """All sums Σ p_i λ_i with whole p_i ≥ 0 and Σ p_i ≤ ``degree``, equal ones once, by rising degree, eq. (7.4).

    A complex rate is followed by its conjugate.
    """
    powers = [p for p in product(range(degree + 1), repeat=len(rates)) if sum(p) <= degree]
    powers.sort(key=lambda p: (sum(p), [-n for n in p]))
    found: list[complex] = []
    for p in powers:
        rate = complex(np.dot(p, rates))
        if abs(rate.imag) <= SAME * (1 + abs(rate)):
            rate = complex(rate.real)
        if rate.imag >= 0 and all(abs(rate - other) > SAME * (1 + abs(rate)) for other in found):
            found.append(rate)
    return np.array([one for rate in found for one in ((rate,) if rate.imag == 0 else (rate, rate.conjugate()))])


def check_growth(rates: ComplexArray, seconds: float) -> None:
    """Raise ``InvalidValueError`` where e^{λT} would leave the floating-point range within ``seconds``."""
    fastest = rates[rates.real.argmax()]
    if fastest.real * seconds > LARGEST_EXPONENT:
        raise InvalidValueError(
            f"the rate {fastest.real:.4g} 1/s makes exp(rate · time) overflow within {seconds:g} s: "
            "lower fit-eigen.degree or simulate.steps, or give trajectories that do not grow"
        )


def comb(spectrum: Spectrum) -> ComplexArray:
    """Rates -damping ± iω with ω even from low to high, then 0 and -damping, eq. (7.10): of no data at all."""
    frequencies = np.linspace(spectrum.low, spectrum.high, spectrum.pairs)
    pairs = np.repeat(-spectrum.damping + 1j * frequencies, 2)
    pairs[1::2] = pairs[1::2].conj()
    return np.concatenate([pairs, [0.0, -spectrum.damping]])


def searched(x: Windows, dt: float, spectrum: Spectrum) -> ComplexArray:
    """The rates, as many as those of the comb, whose exponentials hold the windows ``x`` best, eq. (7.11).

    Variable projection: the coefficients are eliminated, and the logarithm of what is left is followed downhill with
    its exact gradient.
    """
    from scipy.optimize import minimize  # noqa: PLC0415  (only this one needs it)

    start = comb(spectrum)
    pairs, single = start[: 2 * spectrum.pairs : 2], start[2 * spectrum.pairs :]
    count = spectrum.pairs
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

    found = minimize(
        left,
        np.concatenate([pairs.real, pairs.imag, single.real]),
        jac=True,
        method="L-BFGS-B",
        bounds=[(SLOWEST, FASTEST)] * count + [(LOWEST, HIGHEST)] * count + [(SLOWEST, FASTEST)] * len(single),
        options={"maxiter": ROUNDS},
    )
    return _assembled(found.x, count)


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


def _of_the_map(x: FloatArray, windows: Windows, dt: float, spectrum: Spectrum) -> ComplexArray:
    return lattice(dmd_rates(x, dt), spectrum.degree)


RATES: dict[str, Callable[[FloatArray, Windows, float, Spectrum], ComplexArray]] = {
    "dmd": _of_the_map,
    "comb": lambda x, windows, dt, spectrum: comb(spectrum),
    "varpro": lambda x, windows, dt, spectrum: searched(windows, dt, spectrum),
}
