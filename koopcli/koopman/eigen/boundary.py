"""Values of eigenfunctions where trajectories start, and what C makes of them (docs/equations.md 7)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from koopcli.koopman.predictor.modes import Modes, exponentials
from koopcli.records import BoolArray, FloatArray


@dataclass(frozen=True)
class Solution:
    """Lifted initial states ``starts`` (J, copies, L or 1) and ``C`` (n_x, copies · L), with the regression's numbers.

    ``rank`` of ``directions`` were kept; ``condition`` is the largest over the smallest singular value before the cut;
    ``missed``: the share of the trajectories, in percent, that the fit does not hold.
    """

    starts: FloatArray
    C: FloatArray
    rank: int
    directions: int
    condition: float
    missed: float


@dataclass(frozen=True)
class Time:
    """The exponentials over the window, taken apart: e^{λt} / length = ``left`` · diag(``singular``) · …

    ``driven`` (L, L) writes the columns of ``left`` as what a block does when its first state is set, ``seen`` as what
    its last state does when all are set.
    """

    left: FloatArray
    singular: FloatArray
    driven: FloatArray
    seen: FloatArray

    def kept(self, cut: float) -> BoolArray:
        """Which directions are not below ``cut`` times the largest, (L,)."""
        return np.asarray(self.singular > cut * self.singular[0])


def time_part(modes: Modes, samples: int) -> Time:
    """The time part of the regressors, in coordinates in which sums of it lose no digits (7.2)."""
    V = exponentials(modes.rates, modes.dt * np.arange(float(samples)))
    left, singular, _ = np.linalg.svd(V / _lengths(V), full_matrices=False)
    powers = modes.powers(samples - 1)
    return Time(left, singular, _coordinates(powers[:, :, 0], left), _coordinates(powers[:, -1, :], left))


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
    time = time_part(modes, x.shape[1])
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
        condition=condition_of(both),
        missed=_missed(x, np.where(keep, seen.transpose(1, 0, 2), 0.0)),
    )


def fit_free(x: FloatArray, modes: Modes, cut: float) -> Solution:
    """The best boundary values for every state, rate and trajectory of ``x`` (J, samples, n_x), eq. (7.8).

    One small least squares for each trajectory, all with the same regressors; ``C`` then only reads off the last state
    of each block. ``modes`` has one copy here.
    """
    time = time_part(modes, x.shape[1])
    keep = time.kept(cut)
    held = np.tensordot(x, time.left[:, keep], axes=(1, 0))  # (J, n_x, kept)
    n_x, L = x.shape[2], len(modes.rates)
    return Solution(
        starts=held @ time.seen[:, keep].T,  # (J, n_x, L)
        C=read_off(n_x, L),
        rank=int(keep.sum()),
        directions=L,
        condition=condition_of(time.singular),
        missed=_missed(x, held),
    )


def read_off(states: int, rates: int) -> FloatArray:
    """C (n_x, n_x · L) that reads the last state of each block."""
    C = np.zeros((states, states, rates))
    C[np.arange(states), np.arange(states), -1] = 1.0
    return C.reshape(states, -1)


def projection(time: Time, cut: float) -> FloatArray:
    """From the samples of a window to the states of a block that hold it best, (L, samples), as in :func:`fit_free`."""
    keep = time.kept(cut)
    return np.asarray(time.seen[:, keep] @ time.left[:, keep].T)


def missed_ahead(x: FloatArray, time: Time, cut: float) -> float:
    """The share of the windows ahead of the samples of ``x`` (J, samples, n_x) that exponentials miss, in percent.

    Every window that lies within the trajectories counts once.
    """
    left = time.left[:, time.kept(cut)]
    size = held = 0.0
    for k in range(x.shape[1] - len(left) + 1):
        window = x[:, k : k + len(left)]
        size += float((window**2).sum())
        held += float((np.tensordot(window, left, axes=(1, 0)) ** 2).sum())
    return _share_left(size, held)


def _missed(x: FloatArray, held: FloatArray) -> float:
    """What orthonormal directions with the coefficients ``held`` leave of ``x``, in percent."""
    return _share_left(float((x**2).sum()), float((held**2).sum()))


def _share_left(size: float, held: float) -> float:
    return 100 * math.sqrt(max(size - held, 0.0) / size) if size > 0 else 0.0


def _lengths(columns: FloatArray) -> FloatArray:
    length = np.linalg.norm(columns, axis=0)
    return np.asarray(np.where(length > 0, length, 1.0))


def condition_of(singular: FloatArray) -> float:
    """The largest over the smallest of ``singular`` values."""
    return float(singular.max() / singular.min()) if singular.min() > 0 else math.inf
