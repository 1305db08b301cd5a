"""Predictions that start afresh from the true state every so often, as a controller's do."""

from __future__ import annotations

from koopcli.koopman.scores.evaluation import Forecaster
from koopcli.records import FloatArray


def restarted(predictor: Forecaster, x: FloatArray, u: FloatArray, every: int) -> tuple[list[int], list[FloatArray]]:
    """The samples k where predictions of the true ``x`` (n, steps+1, n_x) under ``u`` (n, steps, n_u) start, and those.

    A prediction (n, every+1, n_x) holds its start and the ``every`` samples after it; the last may be shorter.
    """
    starts = list(range(0, u.shape[1], every))
    return starts, [predictor.predict(x[:, k], u[:, k : k + every]) for k in starts]
