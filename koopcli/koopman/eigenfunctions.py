"""Koopman eigenfunctions from data (docs/equations.md 7): rates, boundary functions, and what C makes of them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.koopman.coverage import coverage_of
from koopcli.koopman.modes import ComplexArray, Modes, exponentials, newton_couplings
from koopcli.koopman.predictor import TABLES, Predictor
from koopcli.koopman.thin_plate import draw_centres, thin_plate
from koopcli.records import FloatArray, Trajectories

LARGEST_EXPONENT = 230.0  # e^230 = 1e100: products of a few such numbers are still finite
SAME = 1e-9  # relative distance below which two rates are one


def fit(
    trajectories: Trajectories,
    *,
    degree: int,
    boundary: str,
    centres: int,
    seed: int,
    scaling: str,
    cut: float | None,
    tabulated: int,
    lift: str = "nearest",
) -> Predictor:
    """The predictor whose lifted states are eigenfunctions, known at the first ``tabulated`` + 1 samples (7.1).

    ``degree`` of the lattice of rates; ``boundary`` functions ``thin-plate`` (with ``centres`` drawn from ``seed``, in
    ``raw`` units or scaled by the ``extent`` of the data) or ``optimal``; ``cut``: smallest singular value kept,
    relative to the largest, working precision if None; ``lift`` one of ``TABLES``. What is left of each trajectory is
    the horizon. Raises ``InvalidValueError`` for inputs that change, trajectories too short for the table or for the
    number of rates, and rates that overflow.
    """
    x, dt = autonomous(trajectories), trajectories.dt
    check_window(trajectories.steps, tabulated, dt)
    check_modes(lattice_size(x.shape[2], degree), trajectories.steps)
    rates = lattice(dmd_rates(x, dt), degree)
    check_growth(rates, trajectories.steps * dt)
    cut = np.finfo(float).eps * x.shape[1] if cut is None else cut
    window = trajectories.steps * dt
    block = Modes(rates, newton_couplings(rates, window), 1, dt)
    if boundary == "thin-plate":
        half = np.ptp(x, axis=(0, 1)) / 2
        scale = np.where(half > 0, half, 1.0) if scaling == "extent" else np.ones(x.shape[2])
        solution = fit_given(x, thin_plate(x[:, 0], draw_centres(x, centres, seed), scale), block, cut)
    else:
        solution = fit_free(x, block, cut)
    modes = replace(block, copies=solution.starts.shape[1])
    table = x[:, : tabulated + 1]
    states = table.reshape(-1, x.shape[2])
    return Predictor(
        observables=TABLES[lift](table, solution.starts, modes),
        A=modes,
        B=np.zeros((len(modes), len(trajectories.input_channels))),
        C=solution.C,
        dt=dt,
        coverage=coverage_of(lambda: [states], len(states)),
        state_channels=trajectories.state_channels,
        input_channels=trajectories.input_channels,
        rank=solution.rank,
        directions=solution.directions,
        condition=solution.condition,
        spectral_radius=float(np.abs(modes.eigenvalues).max()),
        horizon=trajectories.steps - tabulated,
        plant=trajectories.plant,
    )


def check_window(steps: int, tabulated: int, dt: float) -> None:
    """Raise ``InvalidValueError`` where ``tabulated`` of ``steps`` samples leave nothing to predict with."""
    if tabulated >= steps:
        raise InvalidValueError(
            f"'fit-eigen.tabulate' of {tabulated * dt:g} s leaves nothing of trajectories of {steps * dt:g} s: a "
            "looked-up state is followed to the end of its trajectory; tabulate less, or simulate more steps"
        )


def check_modes(modes: int, steps: int) -> None:
    """Raise ``InvalidValueError`` for more ``modes`` than samples to tell them apart."""
    if modes > steps:
        raise InvalidValueError(
            f"'fit-eigen.degree' gives {modes:,} rates for trajectories of {steps} steps, which cannot tell them "
            "apart: lower the degree or simulate more steps"
        )


def autonomous(trajectories: Trajectories) -> FloatArray:
    """All states (J, samples, n_x), after checking that one constant input drives them all."""
    acting = np.asarray(trajectories.u[0])[0]
    for start in range(0, len(trajectories), 4096):
        u = np.asarray(trajectories.u[start : start + 4096])
        if (u != acting).any():
            j = start + int(np.argmax((u != acting).any(axis=(1, 2))))
            raise InvalidValueError(
                f"the inputs of these trajectories change or differ (trajectory {j}): an eigenfunction e^(λt) g(x0) "
                "belongs to a system that runs by itself; give trajectories without inputs, such as those of kind "
                "'ellipsoid', or fit with fit-edmd"
            )
    x = np.asarray(trajectories.x[:])
    if not np.isfinite(x).all():
        j = int(np.argmin(np.isfinite(x).all(axis=(1, 2))))
        raise InvalidValueError(f"trajectory {j} holds values that are not finite: leave it out")
    return x


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


@dataclass(frozen=True)
class Solution:
    """Lifted initial states ``starts`` (J, copies, L or 1) and ``C`` (n_x, copies · L), with the regression's numbers.

    ``rank`` of ``directions`` were kept; ``condition`` is the largest over the smallest singular value before the cut.
    """

    starts: FloatArray
    C: FloatArray
    rank: int
    directions: int
    condition: float


@dataclass(frozen=True)
class _Time:
    """The exponentials over the window, taken apart: e^{λt} / length = ``left`` · diag(``singular``) · …

    ``driven`` (L, L) writes the columns of ``left`` as what a block does when its first state is set, ``seen`` as what
    its last state does when all are set.
    """

    left: FloatArray
    singular: FloatArray
    driven: FloatArray
    seen: FloatArray


def _time(modes: Modes, samples: int) -> _Time:
    """The time part of the regressors, in coordinates in which sums of it lose no digits (7.2)."""
    V = exponentials(modes.rates, modes.dt * np.arange(float(samples)))
    left, singular, _ = np.linalg.svd(V / _lengths(V), full_matrices=False)
    powers = modes.powers(samples - 1)
    return _Time(left, singular, _coordinates(powers[:, :, 0], left), _coordinates(powers[:, -1, :], left))


def _coordinates(basis: FloatArray, values: FloatArray) -> FloatArray:
    """``values`` (samples, m) in the columns of ``basis`` (samples, L), (L, m)."""
    size = _lengths(basis)
    return np.asarray(np.linalg.lstsq(basis / size, values, rcond=None)[0] / size[:, np.newaxis])


def fit_given(x: FloatArray, g: FloatArray, modes: Modes, cut: float) -> Solution:
    """C by least squares of ``x`` (J, samples, n_x) on g(x_0) ⊗ e^{λt}, for ``g`` (J, functions), eq. (7.7).

    The singular values of the regressors are the products of those of their two factors, columns scaled to length
    one; directions below ``cut`` times the largest are left out. The functions g are recombined to be orthonormal on
    the initial states: the same eigenfunctions span the same fit, without the digits that near-dependent g would cost.
    ``modes`` has one copy here.
    """
    time = _time(modes, x.shape[1])
    left, singular, _ = np.linalg.svd(g / _lengths(g), full_matrices=False)
    both = np.outer(singular, time.singular)
    keep = both > cut * both.max()
    seen = np.tensordot(np.tensordot(left.T, x, axes=1), time.left, axes=(1, 0))  # (copies, n_x, L)
    C = np.where(keep, seen.transpose(1, 0, 2), 0.0) @ time.driven.T
    return Solution(
        starts=left[:, :, np.newaxis],
        C=C.reshape(x.shape[2], -1),
        rank=int(keep.sum()),
        directions=both.size,
        condition=_ratio(both),
    )


def fit_free(x: FloatArray, modes: Modes, cut: float) -> Solution:
    """The best boundary values for every state, rate and trajectory of ``x`` (J, samples, n_x), eq. (7.8).

    One small least squares for each trajectory, all with the same regressors; ``C`` then only reads off the last state
    of each block. ``modes`` has one copy here.
    """
    time = _time(modes, x.shape[1])
    keep = time.singular > cut * time.singular[0]
    starts = np.tensordot(x, time.left[:, keep], axes=(1, 0)) @ time.seen[:, keep].T  # (J, n_x, L)
    n_x, L = x.shape[2], len(modes.rates)
    C = np.zeros((n_x, n_x, L))
    C[np.arange(n_x), np.arange(n_x), -1] = 1.0
    return Solution(
        starts=starts,
        C=C.reshape(n_x, -1),
        rank=int(keep.sum()),
        directions=L,
        condition=_ratio(time.singular),
    )


def _lengths(columns: FloatArray) -> FloatArray:
    length = np.linalg.norm(columns, axis=0)
    return np.asarray(np.where(length > 0, length, 1.0))


def _ratio(singular: FloatArray) -> float:
    return float(singular.max() / singular.min()) if singular.min() > 0 else math.inf
