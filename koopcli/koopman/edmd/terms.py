"""How inputs act on lifted states: which terms a regression has, and the dynamics that they make."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from koopcli.choices import Choice
from koopcli.koopman.edmd.generator import generator_of
from koopcli.koopman.edmd.operators import Operators
from koopcli.koopman.predictor.dynamics import Dynamics
from koopcli.koopman.predictor.dynamics.bilinear import Bilinear
from koopcli.koopman.predictor.dynamics.generator import Generator
from koopcli.koopman.predictor.dynamics.linear import Linear


class Terms(Choice):
    """Which terms: with ``products`` u_i N_i z or without. ``needs_constant``: among the observables."""

    products: ClassVar[bool] = False
    of_states: ClassVar[bool] = False
    """Whether the products are with the present states alone, not with all that is lifted."""
    needs_constant: ClassVar[bool] = False
    rolled: ClassVar[int]
    """About how many products with every matrix a step takes, beside that with A."""
    label: ClassVar[str] = "{}"
    """What a predictor with them is called, from the name that its basis gives."""

    def count(self, functions: int, inputs: int) -> int:
        """Coefficients of each of so many lifted states."""
        return functions * (1 + inputs) if self.products else functions + inputs

    def dynamics(self, operators: Operators, constant: int | None, dt: float) -> Dynamics:
        """The dynamics with the fitted operators; ``constant``: which observable is one everywhere; ``dt`` in s."""
        raise NotImplementedError


@dataclass(frozen=True)
class LinearTerms(Terms):
    """B u."""

    kind: ClassVar[str] = "linear"
    rolled = 0

    def dynamics(self, operators: Operators, constant: int | None, dt: float) -> Dynamics:
        """z⁺ = A z + B u."""
        return Linear(operators.A, operators.B)


@dataclass(frozen=True)
class BilinearTerms(Terms):
    """B u and products u_i N_i z."""

    kind: ClassVar[str] = "bilinear"
    products = True
    rolled = 1
    label = "bilinear {}"

    def dynamics(self, operators: Operators, constant: int | None, dt: float) -> Dynamics:
        """z⁺ = A z + B u + Σ u_i N_i z."""
        assert operators.N is not None, "fitted with products"
        return Bilinear(operators.A, operators.B, operators.N)


@dataclass(frozen=True)
class ProductTerms(Terms):
    """B u and products of the inputs with the present states alone, as measured data ask for."""

    kind: ClassVar[str] = "products"
    products = True
    of_states = True
    needs_constant = True
    rolled = 1
    label = "{}, products"

    def dynamics(self, operators: Operators, constant: int | None, dt: float) -> Dynamics:
        """z⁺ = A z + B u + Σ u_i N_i z."""
        assert operators.N is not None, "fitted with products"
        return Bilinear(operators.A, operators.B, operators.N)


@dataclass(frozen=True)
class GeneratorTerms(Terms):
    """Such a system in continuous time, whose held inputs act exactly."""

    kind: ClassVar[str] = "generator"
    products = True
    needs_constant = True
    rolled = 10
    label = "bilinear {}, generator"

    def dynamics(self, operators: Operators, constant: int | None, dt: float) -> Dynamics:
        """ż = (K_0 + Σ u_i K_i) z."""
        assert operators.N is not None, "fitted with products"
        assert constant is not None, "a basis without a constant is refused by whoever chooses it"
        return Generator(generator_of(operators.A, operators.B, operators.N, constant, dt), dt)
