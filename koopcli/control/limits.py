"""How far and how fast steer and slip may go."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from koopcli.records import FloatArray

INPUTS = ("steer_f", "slip_f", "steer_r", "slip_r")
STEER, SLIP = 0.6, 0.15  # rad and 1: the bounds of section 2, by which penalties are scaled too
STEER_RATE, SLIP_RATE = 4.0, 3.0  # rad/s and 1/s
SCALE = np.array([STEER, SLIP, STEER, SLIP])


@dataclass(frozen=True)
class Limits:
    """Bounds of |steer| in rad and |slip| in 1 of the front and the rear axle, and of their rates in 1/s.

    A rear steer bound of zero makes a car that steers in front only.
    """

    steer: float = STEER
    steer_rear: float = STEER
    slip: float = SLIP
    steer_rate: float = STEER_RATE
    slip_rate: float = SLIP_RATE

    @cached_property
    def bounds(self) -> FloatArray:
        """The largest absolute value of [steer_f, slip_f, steer_r, slip_r], (4,)."""
        return np.array([self.steer, self.slip, self.steer_rear, self.slip])

    @cached_property
    def rates(self) -> FloatArray:
        """The largest absolute rate of each input in its unit per second, (4,)."""
        return np.array([self.steer_rate, self.slip_rate, self.steer_rate, self.slip_rate])

    def clip(self, wanted: FloatArray, now: FloatArray, dt: float) -> FloatArray:
        """The inputs (4,) nearest to ``wanted`` that ``now`` can reach within ``dt`` s: rates first, then bounds."""
        reach = self.rates * dt
        return np.minimum(
            np.maximum(np.minimum(np.maximum(wanted, now - reach), now + reach), -self.bounds), self.bounds
        )
