"""Windows of held-out rows: where forecasts start, how far they go, and what they are compared with (10.7)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from koopcli.koopman.selection.blocks import Piece, joined
from koopcli.records import FloatArray, IndexArray

HISTORY = 0.4  # s before the first forecast of a piece, whatever the memory
AHEAD = 1.0  # s of a forecast
HORIZONS = (0.25, 0.5, 1.0)  # s after its start, where a forecast is judged
INNER = 0.6  # s between the starts of forecasts that decide a choice
OUTER = 0.3  # s between those of the verdict
TINY = 1e-7  # of the spread of a state: errors below are all the same


def nearest(time: float, dt: float) -> int:
    """The step nearest ``time`` (both in s), the even one of two; at least one."""
    return max(1, round(time / dt))


@dataclass(frozen=True)
class Windows:
    """Forecasts of a log with a step of ``dt`` s: how many rows of ``history`` they have, and steps ``ahead``."""

    dt: float
    history: int
    ahead: int

    @classmethod
    def of(cls, dt: float, memory: float) -> Windows:
        """Windows for predictors whose longest ``memory`` is given, all in s."""
        return cls(dt, max(nearest(HISTORY, dt), round(memory / dt)), nearest(AHEAD, dt))

    @property
    def length(self) -> float:
        """The s that one window takes."""
        return (self.history + self.ahead) * self.dt

    @property
    def horizons(self) -> dict[float, int]:
        """The steps of the horizons in s, counted from the start."""
        return {time: nearest(time, self.dt) for time in HORIZONS}

    def starts(self, pieces: Sequence[Piece], every: float) -> IndexArray:
        """The rows (windows,) where forecasts start, ``every`` so many s; a window lies in one piece."""
        step = nearest(every, self.dt)
        return joined([np.arange(piece.start + self.history, piece.stop - self.ahead, step) for piece in pieces])


def ahead_of(values: FloatArray, starts: IndexArray, steps: int) -> FloatArray:
    """The ``values`` (rows, n) after each start, (windows, steps, n)."""
    return np.asarray(values[starts[:, None] + np.arange(1, steps + 1)])


def rmse(errors: FloatArray) -> FloatArray:
    """Root mean square over the windows of ``errors`` (windows, steps, n), (steps, n)."""
    return np.asarray(np.sqrt(np.mean(errors**2, axis=0)))
