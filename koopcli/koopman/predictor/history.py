"""What a predictor with a memory starts from: its first state and the steps before it."""

from __future__ import annotations

import math

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.koopman.predictor.memory import Memory
from koopcli.records import FloatArray

History = tuple[FloatArray, FloatArray]
"""Past states (..., p, n_x) and past inputs (..., p, n_u), newest first."""


def past_of(history: History, shape: tuple[int, ...], memory: int, n_x: int, n_u: int) -> History:
    """The last ``memory`` steps of a ``history``, (n, p, n_x) and (n, p, n_u), of starts of the ``shape`` (...).

    Raises ``InvalidValueError`` for a history of other starts, states or inputs, or of fewer steps.
    """
    past_x, past_u = (np.asarray(past, dtype=float) for past in history)
    sizes = zip((past_x, past_u), (n_x, n_u), strict=True)
    fits = all(past.ndim == len(shape) + 2 and past.shape[:-2] == shape and past.shape[-1] == k for past, k in sizes)
    if not fits or min(past_x.shape[-2], past_u.shape[-2]) < memory:
        raise InvalidValueError(
            f"a history of past states {past_x.shape} and past inputs {past_u.shape} does not fit: expected "
            f"{(*shape, memory, n_x)} and {(*shape, memory, n_u)}, newest first"
        )
    n = math.prod(shape)
    past_x, past_u = past_x[..., :memory, :], past_u[..., :memory, :]
    return past_x.reshape(n, memory, n_x), past_u.reshape(n, memory, n_u)


def augmented(lift: Memory, x: FloatArray, u: FloatArray, past: History | None = None) -> FloatArray:
    """The augmented states of ``x`` (n, n_x) with the ``past``; without it x and the input ``u`` (n, n_u) repeated."""
    if past is not None:
        return lift.augmented(x, *past)
    repeated = (np.repeat(values[:, np.newaxis], lift.memory, axis=1) for values in (x, u))
    return lift.augmented(x, *repeated)
