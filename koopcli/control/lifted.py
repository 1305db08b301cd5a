"""What E asks of a lift: the future of a state that ψ is projected from, and its derivative by the state."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from koopcli.control.condense import Future
from koopcli.records import FloatArray


class Followed(Protocol):
    """A lift by interpolated futures."""

    def future_with_slopes(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """What follows the states ``x`` (n, n_x), (n, samples, n_x), and its derivative (n, samples, n_x, n_x)."""


def future_of(lift: Followed) -> Future:
    """The future of one state, with its derivative.

    The ``lift`` is asked once: tables that it makes are then there before the first step, and one without a derivative
    raises ``InvalidValueError`` here.
    """

    def future(x: FloatArray) -> tuple[FloatArray, FloatArray]:
        ahead, by_x = lift.future_with_slopes(x[np.newaxis])
        return ahead[0], by_x[0]

    future(np.zeros(3))
    return future
