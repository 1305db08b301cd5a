"""The generator of a bilinear predictor: its continuous-time system, whose held inputs act exactly (4.8), (4.9)."""

from __future__ import annotations

import warnings

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.records import FloatArray

AGREES = 1e-8  # of the largest entry: how well e^{K dt} gives the fitted step back


def generator_of(A: FloatArray, B: FloatArray, N: FloatArray, constant: int, dt: float) -> FloatArray:
    """K_0 = log(A) / dt and the K_i whose step has the derivative N_i by u_i at u = 0: (1 + n_u, N, N) in 1/s.

    The logarithm of [[A, N_i], [0, A]] is [[K_0, K_i], [0, K_0]] dt, whatever A's eigenvectors are; B stands in the
    column of the ``constant``. Raises ``InvalidValueError`` where a step has no real logarithm.
    """
    from scipy.linalg import expm, logm  # noqa: PLC0415  (other fits go without)

    functions = len(A)
    blocks: list[FloatArray] = []
    for i, products in enumerate(N):
        slope = products.copy()
        slope[:, constant] += B[:, i]
        size = np.abs(slope).max() or 1.0  # of the size of A, so that neither hides the other
        step = np.block([[A, slope / size], [np.zeros_like(A), A]])
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            log = np.asarray(logm(step))
        real = log.real.astype(float)
        if not (np.isfinite(log).all() and np.abs(expm(real) - step).max() <= AGREES * np.abs(step).max()):
            raise InvalidValueError(
                "the fitted step has no real generator, as one that turns or decays too far within a sample has not: "
                "lower simulate.dt, or use --terms bilinear"
            )
        if not blocks:
            blocks.append(real[:functions, :functions] / dt)
        blocks.append(real[:functions, functions:] * size / dt)
    return np.stack(blocks)
