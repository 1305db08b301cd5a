"""Scores of predicted against true trajectories (docs/equations.md 5)."""

from __future__ import annotations

import numpy as np

from koopcli.records import BoolArray, FloatArray


def rmse(predicted: FloatArray, true: FloatArray) -> FloatArray:
    """Error in percent of the trajectory's own size (5.1), for (n, samples, n_x) in raw SI units, as (n,).

    Not a number where a true trajectory is identically zero.
    """
    error = np.sqrt(((predicted - true) ** 2).sum(axis=(1, 2)))
    size = np.sqrt((true**2).sum(axis=(1, 2)))
    return _percent(error, size)


def rmse_printed(predicted: FloatArray, true: FloatArray) -> FloatArray:
    """The paper's printed formula (5.2), whose denominator is the norm of the sum instead of the sum of norms."""
    error = np.sqrt(((predicted - true) ** 2).sum(axis=(1, 2)))
    size = np.linalg.norm(true.sum(axis=1), axis=1)
    return _percent(error, size)


def diverged(predicted: FloatArray, domain: FloatArray, factor: float = 1e6) -> BoolArray:
    """Which predictions (n, samples, n_x) leave the finite numbers or ``factor`` times the training box, as (n,)."""
    limit = factor * np.abs(domain).max(axis=0)
    within = np.isfinite(predicted) & (np.abs(predicted) <= limit)  # nan and inf compare as outside
    return np.asarray(~within.all(axis=(1, 2)))


def in_domain(true: FloatArray, domain: FloatArray) -> FloatArray:
    """Share of the samples (n, samples, n_x) that lie in the box ``domain`` (2, n_x), as (n,)."""
    inside = ((true >= domain[0]) & (true <= domain[1])).all(axis=2)
    share: FloatArray = inside.mean(axis=1)
    return share


def overlap_of_largest(values: FloatArray, others: FloatArray, share: float = 0.05) -> float:
    """Share of the rows with the largest ``values`` (n,) that are also among those with the largest ``others`` (n,).

    ``share`` of all rows count as largest, one at least; not a number without any finite value.
    """
    finite = np.isfinite(values)
    count = max(1, round(share * int(finite.sum())))
    if not finite.any():
        return float("nan")
    largest = np.argsort(values[finite], kind="stable")[-count:]
    return float(np.isin(largest, np.argsort(others[finite], kind="stable")[-count:]).mean())


def summary(values: FloatArray) -> dict[str, float]:
    """Mean, standard deviation (ddof 0), median and maximum of the finite values; not a number without any."""
    finite = values[np.isfinite(values)]
    if not len(finite):
        return dict.fromkeys(("mean", "std", "median", "max"), float("nan"))
    return {
        "mean": float(finite.mean()),
        "std": float(finite.std()),
        "median": float(np.median(finite)),
        "max": float(finite.max()),
    }


def _percent(error: FloatArray, size: FloatArray) -> FloatArray:
    ratio = np.full(error.shape, np.nan)
    np.divide(100 * error, size, out=ratio, where=size > 0)
    return ratio
