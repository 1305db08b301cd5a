"""What a choice of rates is."""

from __future__ import annotations

from collections.abc import Sequence

from koopcli.choices import Choice
from koopcli.errors import InvalidValueError
from koopcli.koopman.predictor.modes import ComplexArray
from koopcli.records import FloatArray

LARGEST_EXPONENT = 230.0  # e^230 = 1e100: products of a few such numbers are still finite

Windows = Sequence[FloatArray]  # (J, samples, n_x) each, of one length


class Rates(Choice):
    """Where rates come from."""

    def count(self, states: int) -> int:
        """How many real modes they have, of so many ``states``."""
        raise NotImplementedError

    def check(self) -> None:
        """Raise ``InvalidValueError`` for settings that do not go together."""

    def find(self, x: FloatArray, windows: Windows, dt: float) -> ComplexArray:
        """The rates (L,) in 1/s for trajectories ``x`` (J, samples, n_x) every ``dt`` s, and for windows of them.

        A complex rate is followed by its conjugate.
        """
        raise NotImplementedError


def check_growth(rates: ComplexArray, seconds: float) -> None:
    """Raise ``InvalidValueError`` where e^{λT} would leave the floating-point range within ``seconds``."""
    fastest = rates[rates.real.argmax()]
    if fastest.real * seconds > LARGEST_EXPONENT:
        raise InvalidValueError(
            f"the rate {fastest.real:.4g} 1/s makes exp(rate · time) overflow within {seconds:g} s: "
            "lower fit-eigen.degree or simulate.steps, or give trajectories that do not grow"
        )
