"""What a basis of observables ψ(x) is, and what a choice of one is."""

from __future__ import annotations

from typing import Any, ClassVar, Protocol

from koopcli.choices import Choice
from koopcli.koopman.bases.moments import Products
from koopcli.koopman.predictor.lifts import Explicit
from koopcli.records import FloatArray


class Basis(Explicit, Protocol):
    """A lift by explicit functions of the state, which EDMD can fit."""

    def lift_rows(self, x: FloatArray, out: FloatArray) -> None:
        """ψ(x) of the states (n, n_x) as rows into ``out`` (N, n), which is contiguous."""

    @property
    def products(self) -> Products | None:
        """How the products of two observables are sums of fewer functions (3.5), where they are."""

    def group_moments(self, x: FloatArray, weights: FloatArray) -> FloatArray:
        """Σ_j weights[j] ψ(x[s, j]) as (n, q, N), for states in groups (n, m, n_x) and weights (m, q)."""


class BasisChoice(Choice):
    """A kind of basis with its settings. ``makes``: the class of the bases that it makes, which says what they are in
    a store (``stored``) and how they are read back (``unpack``).
    """

    makes: ClassVar[Any]
    sized_by: ClassVar[str] = ""
    """The setting that makes it large, if there is one."""
    of_states: ClassVar[bool] = False
    """Whether it needs as many different states as it has functions, which only data tell."""

    @property
    def name(self) -> str:
        """What an EDMD predictor with it is called."""
        raise NotImplementedError

    def make(self, x: FloatArray, *, raw: bool = False) -> Basis:
        """The basis on the training states ``x`` (n, n_x), of ``raw`` monomials where it is one of polynomials."""
        raise NotImplementedError

    @property
    def seconds(self) -> float:
        """About how long one state takes to be lifted."""
        return 1e-6

    def functions(self, states: int) -> int:
        """Number of observables of so many ``states``."""
        raise NotImplementedError

    def degrees(self, states: int) -> tuple[int, ...]:
        """Of each state's polynomials, which ask for one distinct value more; empty for other bases."""
        return ()
