"""What takes a state to the lifted state z = ψ(x)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, runtime_checkable

from koopcli.records import FloatArray, Packed

Observed = Callable[[FloatArray], FloatArray]


class Observables(Protocol):
    """What a predictor asks of its ψ."""

    @property
    def functions(self) -> int:
        """Dimension N of the lifted state."""

    def lift(self, x: FloatArray) -> FloatArray:
        """ψ(x) (n, N) of the states (n, n_x)."""

    def observe(self, x: FloatArray, rows: FloatArray) -> FloatArray:
        """rows · ψ(x) as (n, R), for ``rows`` (R, N), which need not form ψ(x)."""

    def onto(self, rows: FloatArray) -> Observed:
        """The same for many calls with the same ``rows`` (R, N): a function of ``x`` (n, n_x) to (n, R)."""

    def pack(self) -> Packed:
        """The lift as arrays, with its kind."""


@runtime_checkable
class Differentiable(Observables, Protocol):
    """A lift with a derivative in the state."""

    def with_slopes(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """ψ(x) (n, N) of the states (n, n_x), and ∂ψ/∂x (n, N, n_x)."""


class Explicit(Observables, Protocol):
    """A lift by explicit functions of the state, the states themselves among them."""

    @property
    def constant(self) -> int | None:
        """Index of the observable that is one everywhere, if there is one."""

    @property
    def state_map(self) -> FloatArray:
        """C (n_x, N) with x = C ψ(x) exactly."""
