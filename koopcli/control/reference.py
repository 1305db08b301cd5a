"""What v_x, v_y and yaw rate shall be over time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.records import FloatArray

COLUMNS = ("t", "v_x", "v_y", "yaw_rate")


class Reference(Protocol):
    """A function of time."""

    def __call__(self, t: FloatArray) -> FloatArray:
        """v_x, v_y in m/s and yaw rate in rad/s, (n, 3), at the times ``t`` (n,) in s."""


@dataclass(frozen=True)
class Constant:
    """One state that stays."""

    state: tuple[float, float, float]

    def __call__(self, t: FloatArray) -> FloatArray:
        """The state at ``t`` (n,), (n, 3)."""
        return np.broadcast_to(np.array(self.state), (len(t), 3))


@dataclass(frozen=True)
class Rows:
    """``rows`` of t, v_x, v_y and yaw rate: linear in between, the first held before them and the last after.

    Raises ``InvalidValueError`` for rows of another length, values that are not finite, and times that do not grow.
    """

    rows: tuple[tuple[float, float, float, float], ...]

    def __post_init__(self) -> None:
        for number, row in enumerate(self.rows, 1):
            if len(row) != len(COLUMNS) or not np.isfinite(row).all():
                raise InvalidValueError(
                    f"row {number} of the reference is {tuple(row)}: give {', '.join(COLUMNS)} as finite numbers"
                )
        times = [row[0] for row in self.rows]
        if not self.rows or any(after <= before for before, after in pairwise(times)):
            raise InvalidValueError(
                f"the reference has the times {times}: give at least one row, each later than the last"
            )

    def __call__(self, t: FloatArray) -> FloatArray:
        """The state at ``t`` (n,), (n, 3)."""
        table = np.array(self.rows)
        return np.column_stack([np.interp(t, table[:, 0], table[:, i]) for i in (1, 2, 3)])


@dataclass(frozen=True)
class YawStep:
    """Straight on at ``speed`` m/s, then from ``start`` s on a turn at ``lateral`` m/s²."""

    speed: float = 25.0
    lateral: float = 8.0
    start: float = 0.5

    def __call__(self, t: FloatArray) -> FloatArray:
        """The state at ``t`` (n,), (n, 3)."""
        zero = np.zeros(len(t))
        return np.column_stack([zero + self.speed, zero, np.where(t >= self.start, self.lateral / self.speed, 0.0)])


@dataclass(frozen=True)
class LaneChange:
    """A double lane change at ``speed`` m/s from ``start`` s on: one sine of yaw rate of ``length`` s that reaches
    ``lateral`` m/s², straight on for as long, and the same to the other side.
    """

    speed: float = 25.0
    lateral: float = 8.0
    start: float = 0.5
    length: float = 1.2

    def __call__(self, t: FloatArray) -> FloatArray:
        """The state at ``t`` (n,), (n, 3)."""
        zero = np.zeros(len(t))
        turn = zero
        for begin, side in ((self.start, 1), (self.start + 2 * self.length, -1)):
            on = (t >= begin) & (t < begin + self.length)
            turn = turn + np.where(on, side * np.sin(2 * np.pi * (t - begin) / self.length), 0.0)
        return np.column_stack([zero + self.speed, zero, self.lateral / self.speed * turn])


def reference_of(given: Sequence[float] | Sequence[Sequence[float]]) -> Reference:
    """A user's reference: three numbers that stay, or rows of t, v_x, v_y and yaw rate.

    Raises ``InvalidValueError`` for anything else.
    """
    values = np.asarray(given, dtype=float)
    if values.shape == (3,) and np.isfinite(values).all():
        return Constant((float(values[0]), float(values[1]), float(values[2])))
    if values.ndim == 2 and values.shape[1] == len(COLUMNS):
        return Rows(tuple((float(t), float(v_x), float(v_y), float(r)) for t, v_x, v_y, r in values))
    raise InvalidValueError(
        f"a reference of shape {values.shape} is neither v_x, v_y, yaw_rate nor rows of {', '.join(COLUMNS)}: give one"
    )
