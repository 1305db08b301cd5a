"""Values of eigenfunctions where trajectories start, and what C makes of them (docs/equations.md 7)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from koopcli.choices import SEED_LIMIT, Choice, setting
from koopcli.koopman.bases.thin_plate import draw_centres, thin_plate
from koopcli.koopman.predictor.modes import Modes, exponentials
from koopcli.records import BoolArray, FloatArray

CUT = "smallest singular value kept, relative to the largest, on which the errors depend; else working precision"


@dataclass(frozen=True)
class BoundaryFit:
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


def fit_given(x: FloatArray, g: FloatArray, modes: Modes, cut: float) -> BoundaryFit:
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
    return BoundaryFit(
        starts=left[:, :, np.newaxis],
        C=C.reshape(x.shape[2], -1),
        rank=int(keep.sum()),
        directions=both.size,
        condition=condition_of(both),
        missed=_missed(x, np.where(keep, seen.transpose(1, 0, 2), 0.0)),
    )


def fit_free(x: FloatArray, modes: Modes, cut: float) -> BoundaryFit:
    """The best boundary values for every state, rate and trajectory of ``x`` (J, samples, n_x), eq. (7.8).

    One small least squares for each trajectory, all with the same regressors; ``C`` then only reads off the last state
    of each block. ``modes`` has one copy here.
    """
    time = time_part(modes, x.shape[1])
    keep = time.kept(cut)
    held = np.tensordot(x, time.left[:, keep], axes=(1, 0))  # (J, n_x, kept)
    n_x, L = x.shape[2], len(modes.rates)
    return BoundaryFit(
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


class Boundary(Choice):
    """Where the values of eigenfunctions on Γ come from. ``cut``: the smallest singular value kept, of the largest."""

    cut: float | None

    def copies(self, states: int, starts: int) -> int:
        """Boundary functions of so many ``states`` on so many ``starts``."""
        return states

    def solve(self, x: FloatArray, modes: Modes) -> BoundaryFit:
        """The boundary values and C for trajectories ``x`` (J, samples, n_x); ``modes`` has one copy here."""
        raise NotImplementedError


@dataclass(frozen=True)
class BoundarySplines(Boundary):
    """Thin-plate splines of the state, as in the paper."""

    kind: ClassVar[str] = "thin-plate"
    centres: int = setting(441, low=1, high=100_000, option=True, help="number of splines")
    seed: int = setting(0, low=0, high=SEED_LIMIT, help="seed of their centres")
    scaling: Literal["raw", "extent"] = setting("raw", help="distances in raw SI units, or in half-widths of the data")
    cut: float = setting(1e-14, low=0, high=0.5, option=True, help=CUT)

    def copies(self, states: int, starts: int) -> int:
        """As many as there are splines, and not more than they can be told apart by."""
        return min(starts, self.centres)

    def solve(self, x: FloatArray, modes: Modes) -> BoundaryFit:
        """C by least squares with splines of the initial states."""
        half = np.ptp(x, axis=(0, 1)) / 2
        scale = np.where(half > 0, half, 1.0) if self.scaling == "extent" else np.ones(x.shape[2])
        centres = draw_centres(x, self.centres, self.seed)
        return fit_given(x, thin_plate(x[:, 0], centres, scale), modes, self.cut)


@dataclass(frozen=True)
class Optimal(Boundary):
    """The best values for each trajectory."""

    kind: ClassVar[str] = "optimal"
    cut: float | None = setting(None, low=0, high=0.5, option=True, help=CUT)

    def solve(self, x: FloatArray, modes: Modes) -> BoundaryFit:
        """The best values, and C that reads states off."""
        return fit_free(x, modes, kept(self.cut, x.shape[1]))


def kept(cut: float | None, samples: int) -> float:
    """The ``cut``, or working precision over so many ``samples``."""
    return float(np.finfo(float).eps * samples) if cut is None else cut
