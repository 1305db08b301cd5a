"""The signals of episodes by name, and the few numbers that checks take from them. Nothing crosses a seam."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from koopcli.records import Episodes, FloatArray, IntArray

MOST = 99.9  # per cent of a magnitude: what is rarer may be a spike
FEWEST = 20  # rows that a check needs
LAG_STEP = 0.01  # s, between the lags that are tried on finer grids


@dataclass(frozen=True, eq=False)
class Measured:
    """The signals of episodes by name, each (rows,), and which rows belong together; ``wheelbase`` in m, if known."""

    episodes: Episodes
    wheelbase: float | None

    @cached_property
    def x(self) -> FloatArray:
        """The states, (rows, n_x)."""
        return np.asarray(self.episodes.x[...], dtype=float)

    @cached_property
    def u(self) -> FloatArray:
        """The inputs, (rows, n_u)."""
        return np.asarray(self.episodes.u[...], dtype=float)

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


def best_lag(log: Measured, first: FloatArray, second: FloatArray, longest: float) -> float:
    """By how many s ``second`` (rows,) comes behind ``first`` (rows,) where they correlate best, whatever the sign.

    Lags of up to ``longest`` s either way are tried; of equal ones the shortest counts.
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
    return lag


def side_fit(v_y: FloatArray, r: FloatArray, v: FloatArray) -> tuple[float, float]:
    """a in m of v_y = a r + b r v², and how the right side correlates with the left."""
    columns = np.column_stack([r, r * v**2])
    weights = fit(columns, v_y)
    return float(weights[0]), correlation_of(columns @ weights, v_y)


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
