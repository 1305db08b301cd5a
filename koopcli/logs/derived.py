"""What a raw column becomes before it is put onto the grid: in SI, smoothed, or the rate of a heading."""

from __future__ import annotations

import numpy as np

from koopcli.records import BoolArray, FloatArray


def causal_mean(values: FloatArray, samples: int, restarts: BoolArray) -> FloatArray:
    """The mean of each of ``values`` (n,) and of at most ``samples`` - 1 before it, back to the last restart.

    ``restarts`` (n,): where a silence lies before a sample.
    """
    if samples == 1:
        return values
    place = np.arange(len(values))
    begun = np.maximum.accumulate(np.where(restarts, place, 0))
    total = values.copy()
    for back in range(1, samples):
        total[back:] += np.where(place[back:] - back >= begun[back:], values[:-back], 0.0)
    return np.asarray(total / np.minimum(place - begun + 1, samples))


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
