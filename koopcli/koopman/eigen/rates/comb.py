"""Rates of evenly spaced frequencies, which need no data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from koopcli.choices import setting
from koopcli.errors import InvalidValueError
from koopcli.koopman.eigen.rates.rates import Rates, Windows
from koopcli.koopman.predictor.modes import ComplexArray
from koopcli.records import FloatArray


@dataclass(frozen=True)
class Comb(Rates):
    """A comb of frequencies, which needs no data."""

    kind: ClassVar[str] = "comb"
    pairs: int = setting(10, low=1, high=1000, option=True, help="pairs of complex rates, beside two real ones")
    lowest: float = setting(2.0, above=0, high=1e6, unit="rad/s", help="lowest frequency")
    highest: float = setting(26.0, above=0, high=1e6, unit="rad/s", help="highest frequency")
    damping: float = setting(1.0, low=0, high=1e6, unit="1/s", help="decay of all rates but the constant's")

    def count(self, states: int) -> int:
        """How many real modes they have."""
        return 2 * self.pairs + 2

    def check(self) -> None:
        """Raise ``InvalidValueError`` for frequencies in no order."""
        if self.pairs > 1 and self.lowest >= self.highest:
            raise InvalidValueError(
                f"'fit-eigen.lowest' {self.lowest:g} rad/s must be below 'fit-eigen.highest' {self.highest:g} rad/s"
            )

    @property
    def even(self) -> ComplexArray:
        """Rates -damping ± iω with ω even from the lowest to the highest, then 0 and -damping, eq. (7.10)."""
        frequencies = np.linspace(self.lowest, self.highest, self.pairs)
        pairs = np.repeat(-self.damping + 1j * frequencies, 2)
        pairs[1::2] = pairs[1::2].conj()
        return np.concatenate([pairs, [0.0, -self.damping]])

    def find(self, x: FloatArray, windows: Windows, dt: float) -> ComplexArray:
        """The comb, whatever the data."""
        return self.even
