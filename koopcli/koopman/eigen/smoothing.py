"""Measured trajectories without their noise, by restricted maximum likelihood (docs/equations.md 7)."""

from __future__ import annotations

import math

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.koopman.eigen.frames import turned, yaw
from koopcli.records import FloatArray

STRENGTHS = np.logspace(-2, 12, 57)  # of the penalty on second differences, of which each trajectory takes its own
ORDER = 2  # of the differences
TINY = 1e-300
HIGH = 6  # order of the differences that tell noise from motion
OF_NORMAL = 0.6745  # the median size of a normal number
SEEN = 1e-4  # of the largest magnitude of a state: noise beyond. Clean data sampled at 100 Hz have 4e-7


def smoothed(x: FloatArray, dt: float, *, turns: bool) -> tuple[FloatArray, FloatArray]:
    """The trajectories ``x`` (J, samples, n_x) without their noise, and its variance (J, n_x), eq. (7.21).

    ``turns``: the states are v_x, v_y and the yaw rate first, and velocities are smoothed in axes that stay, where
    they change the least. Raises ``InvalidValueError`` for too few samples.
    """
    samples, n_x = x.shape[1:]
    check_length(samples)
    basis = _differences(samples)
    out, variance = np.empty(x.shape), np.empty((len(x), n_x))
    for i in range(2 if turns else 0, n_x):
        out[..., i], variance[:, i] = _smooth(x[..., i], *basis)
    if turns:
        angle = yaw(out[..., 2], dt)
        seen = turned(x, angle)
        for i in range(2):
            out[..., i], variance[:, i] = _smooth(seen[..., i], *basis)
        out = turned(out, -angle)
    return out, variance


def check_length(samples: int) -> None:
    """Raise ``InvalidValueError`` for so few ``samples`` that noise cannot be told from motion."""
    if samples <= HIGH:
        raise InvalidValueError(
            f"trajectories of {samples} samples are too short to tell noise from motion, {HIGH + 1} are needed: "
            "simulate more steps, or fit them as they are with --no-smooth"
        )


def noisy(x: FloatArray) -> bool:
    """Whether noise is seen in the trajectories ``x`` (J, samples, n_x): what is left of them in differences of high
    order, which motion is too slow for.

    By medians along and among trajectories, since motion has kinks. Of trajectories that are too short for such
    differences nothing is known.
    """
    if x.shape[1] <= HIGH:
        return False
    left = np.abs(np.diff(x, HIGH, axis=1)) / math.sqrt(math.comb(2 * HIGH, HIGH))
    deviation = np.median(np.median(left, axis=1), axis=0) / OF_NORMAL
    return bool((deviation > SEEN * np.abs(x).max(axis=(0, 1))).any())


def _differences(samples: int) -> tuple[FloatArray, FloatArray]:
    """Eigenvectors (samples, samples) of the penalty, and its eigenvalues but for those of straight lines, zero."""
    D = np.diff(np.eye(samples), ORDER, axis=0)
    d, U = np.linalg.eigh(D.T @ D)
    return U, d[ORDER:]


def _smooth(y: FloatArray, U: FloatArray, d: FloatArray) -> tuple[FloatArray, FloatArray]:
    """One channel (J, samples) smoothed, and the variance of its noise (J,)."""
    w = U.T @ y.T
    penalty = np.outer(STRENGTHS, d)
    q = penalty / (1.0 + penalty)
    variance = q @ w[ORDER:] ** 2 / len(d)
    criterion = len(d) * np.log(variance + TINY) - np.log(q).sum(axis=1)[:, np.newaxis]
    best = criterion.argmin(axis=0)
    w[ORDER:] /= 1.0 + penalty[best].T
    return (U @ w).T, variance[best, np.arange(len(best))]
