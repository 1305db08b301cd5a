"""What a raw column becomes before it is put onto the grid: in SI, smoothed, or the rate of a heading."""

from __future__ import annotations

import numpy as np

from koopcli.records import BoolArray, FloatArray


def causal_mean(values: FloatArray, samples: int, restarts: BoolArray) -> FloatArray:
    """The mean of each of ``values`` (n,) and of the ``samples`` - 1 before it; not a number where a restart is nearer.

    ``restarts`` (n,): where a silence lies before a sample. A mean of fewer would be another filter.
    """
    if samples == 1:
        return values
    place = np.arange(len(values))
    begun = np.maximum.accumulate(np.where(restarts, place, 0))
    total = values.copy()
    for back in range(1, samples):
        total[back:] += values[:-back]
    return np.asarray(np.where(place - begun >= samples - 1, total / samples, np.nan))


def heading_rate(time: FloatArray, heading: FloatArray, width: float, restarts: BoolArray) -> FloatArray:
    """The rate in rad/s of a ``heading`` (n,) in rad that may wrap, over the past ``width`` s, or one sample if longer.

    The heading of ``width`` s ago is interpolated. Not a number where a silence or the beginning lies within it.
    """
    unwrapped = np.unwrap(heading)
    step = float(np.median(np.diff(time))) if len(time) > 1 else width
    span = max(width, step)
    begun = time[np.maximum.accumulate(np.where(restarts, np.arange(len(time)), 0))]
    past = time - span
    near = past < begun  # within a thousandth of a step of the first sample it is that sample
    past = np.where(near & (past > begun - 1e-3 * step), begun, past)
    rate = (unwrapped - np.interp(past, time, unwrapped)) / (time - past + (time == past))
    return np.asarray(np.where(past < begun, np.nan, rate))


def restarts_of(time: FloatArray, gap: float) -> BoolArray:
    """Where a silence lies before a sample (n,): of more than ``gap`` s and five median steps; and the first."""
    starts = np.ones(len(time), dtype=bool)
    if len(time) > 1:
        steps = np.diff(time)
        starts[1:] = steps > max(gap, 5 * float(np.median(steps))) * (1 + 1e-9)
    return starts
