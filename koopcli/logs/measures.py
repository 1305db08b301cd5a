"""The signals of episodes by name, and the few numbers that checks take from them. Nothing crosses a seam."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

import numpy as np

from koopcli.logs.check import Verdict
from koopcli.logs.hints import Said
from koopcli.records import Episodes, FloatArray, IntArray

MOST = 99.9  # per cent of a magnitude: what is rarer may be a spike
FEWEST = 20  # rows that a check needs
TOLD = 0.6  # a correlation from which on a fit says something
ISOLATED, REST = 2, 0.1  # rows: so far from a spike a signal is back, but for this share of it
SPIKE = 30.0  # inter-decile ranges
LAG_STEP = 0.01  # s, between the lags that are tried on finer grids


@dataclass(frozen=True, eq=False)
class Spike:
    """The largest deviation of a signal from its median: its ``row``, its ``size`` in inter-decile ranges, and the
    ``rows`` of all that are gone a few rows on.
    """

    row: int
    size: float
    rows: IntArray


@dataclass(frozen=True, eq=False)
class Measured:
    """The signals of episodes by name, each (rows,), and which rows belong together; ``wheelbase`` in m, if known.

    ``said``: what the map says. Spikes are interpolated over, and known as ``spikes``.
    """

    episodes: Episodes
    wheelbase: float | None
    said: Said = field(default_factory=Said)

    @cached_property
    def x(self) -> FloatArray:
        """The states, (rows, n_x)."""
        return self._without_spikes(np.asarray(self.episodes.x[...], dtype=float), self.episodes.state_channels.names)

    @cached_property
    def u(self) -> FloatArray:
        """The inputs, (rows, n_u)."""
        return self._without_spikes(np.asarray(self.episodes.u[...], dtype=float), self.episodes.input_channels.names)

    @cached_property
    def spikes(self) -> dict[str, Spike]:
        """The largest deviation of each signal by name, of those with a range."""
        both = (self.episodes.x, self.episodes.state_channels), (self.episodes.u, self.episodes.input_channels)
        columns = {name: values[:, i] for values, channels in both for i, name in enumerate(channels.names)}
        spikes = {name: spike_of(np.asarray(values, dtype=float)) for name, values in columns.items()}
        return {name: spike for name, spike in spikes.items() if spike is not None}

    def _without_spikes(self, values: FloatArray, names: Sequence[str]) -> FloatArray:
        spiked = [i for i, name in enumerate(names) if name in self.spikes and len(self.spikes[name].rows)]
        values = values.copy() if spiked else values
        for i in spiked:
            kept = np.setdiff1d(np.arange(len(values)), self.spikes[names[i]].rows)
            values[:, i] = np.interp(np.arange(len(values)), kept, values[kept, i])
        return values

    @property
    def dt(self) -> float:
        """Seconds from row to row."""
        return self.episodes.dt

    @cached_property
    def signals(self) -> dict[str, FloatArray]:
        """States and inputs by name, each (rows,)."""
        inputs = dict(zip(self.episodes.input_channels.names, self.u.T, strict=True))
        return inputs | dict(zip(self.episodes.state_channels.names, self.x.T, strict=True))

    def get(self, *names: str) -> list[FloatArray] | None:
        """The signals of these names; None where one is missing or there are too few rows."""
        enough = len(self.x) >= FEWEST and all(name in self.signals for name in names)
        return [self.signals[name] for name in names] if enough else None

    def steps(self, seconds: float) -> int:
        """So many seconds in steps, one at least."""
        return max(1, round(seconds / self.dt))

    def pairs(self, steps: int) -> IntArray:
        """The rows that have one ``steps`` later in the same episode, (n,)."""
        ends = np.repeat(self.episodes.bounds[1:], self.episodes.lengths)
        rows = np.arange(len(ends))
        return rows[rows + steps < ends]


def spike_of(values: FloatArray) -> Spike | None:
    """The largest deviation of ``values`` (rows,) from their median; None where most of them are one number."""
    if len(values) < FEWEST:
        return None
    low, median, high = np.percentile(values, [10, 50, 90])
    if not high > low:
        return None
    sizes = np.abs(values - median) / (high - low)
    row = int(np.argmax(sizes))
    tall = np.flatnonzero(sizes > SPIKE)
    before, after = sizes[np.maximum(tall - ISOLATED, 0)], sizes[np.minimum(tall + ISOLATED, len(sizes) - 1)]
    gone = np.maximum(before * (tall >= ISOLATED), after * (tall + ISOLATED < len(sizes))) < REST * sizes[tall]
    return Spike(row, float(sizes[row]), tall[gone])


def best_lag(log: Measured, first: FloatArray, second: FloatArray, longest: float) -> tuple[float, float]:
    """By how many s ``second`` (rows,) comes behind ``first`` (rows,) where they correlate best, and how well they do.

    The sign does not count. Lags of up to ``longest`` s either way are tried; of equal ones the shortest counts.
    """
    a, b = first - first.mean(), second - second.mean()
    stride = log.steps(LAG_STEP)
    strides = log.steps(longest) // stride
    best, lag = -1.0, 0.0
    for shift in sorted(range(-strides * stride, strides * stride + 1, stride), key=abs):
        sums = np.zeros(3)
        for begin, end in pairwise(log.episodes.bounds):
            if end - begin > abs(shift):
                p = a[begin + max(0, -shift) : end - max(0, shift)]
                q = b[begin + max(0, shift) : end - max(0, -shift)]
                sums += (p @ q, p @ p, q @ q)
        correlation = abs(sums[0]) / np.sqrt(sums[1] * sums[2])
        if correlation > best:
            best, lag = correlation, shift * log.dt
    return lag, float(best)


def side_fit(v_y: FloatArray, r: FloatArray, v: FloatArray) -> tuple[float, float]:
    """a in m of v_y = a r + b r v², and how the right side correlates with the left."""
    columns = np.column_stack([r, r * v**2])
    weights = fit(columns, v_y)
    return float(weights[0]), correlation_of(columns @ weights, v_y)


def slope_of(first: FloatArray, second: FloatArray) -> float:
    """How many times ``second`` (n,) ``first`` (n,) is, with noise in both; nan where they do not go together."""
    correlation = correlation_of(first, second)
    return float(np.sign(correlation) * first.std() / second.std()) if abs(correlation) > TOLD else np.nan


def spread(v: FloatArray, r: FloatArray) -> float:
    """How far ``v`` (n,) lies from its mean, as a share of it, where the yaw rate ``r`` (n,) is large."""
    if not r.any():
        return 0.0
    mean = np.average(v, weights=r**2)
    return float(np.sqrt(np.average((v - mean) ** 2, weights=r**2)) / abs(mean))


def above(value: float, warn: float, ask: float) -> Verdict:
    """What a value means that should be small."""
    return "ask" if value > ask else "warn" if value > warn else "ok"


def below(value: float, warn: float, ask: float) -> Verdict:
    """What a value means that should be large."""
    return "ask" if value < ask else "warn" if value < warn else "ok"


def correlation_of(a: FloatArray, b: FloatArray) -> float:
    """The correlation of two signals, nan where one does not vary."""
    return float(np.corrcoef(a, b)[0, 1])


def most(values: FloatArray) -> float:
    """99.9 % of the magnitude."""
    return float(np.percentile(np.abs(values), MOST))


def rms(values: FloatArray) -> float:
    """The root of the mean square."""
    return float(np.sqrt(np.mean(values**2)))


def varies(values: FloatArray) -> bool:
    """Whether it has more than one value."""
    return bool(np.ptp(values) > 0)


def scaled(values: FloatArray) -> FloatArray:
    """Columns with mean zero and deviation one; constant ones are zero."""
    deviation = values.std(axis=0)
    return np.asarray((values - values.mean(axis=0)) / np.where(deviation > 0, deviation, 1.0))


def fit(columns: FloatArray, values: FloatArray) -> FloatArray:
    """The least-squares weights of ``columns`` (rows, n) for ``values`` (rows,), (n,)."""
    return np.asarray(np.linalg.lstsq(columns, values, rcond=None)[0])


def explained(columns: FloatArray, values: FloatArray) -> float:
    """R² of the least squares of ``values`` (rows,) by ``columns`` (rows, n), of which the first is one."""
    left = values - columns @ fit(columns, values)
    return float(1 - left @ left / np.sum((values - values.mean()) ** 2))
