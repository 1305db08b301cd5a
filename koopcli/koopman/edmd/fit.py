"""Extended dynamic mode decomposition with inputs (docs/equations.md 4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from koopcli.checks import Settings
from koopcli.choices import setting
from koopcli.errors import InvalidValueError
from koopcli.koopman.bases.basis import Basis, BasisChoice
from koopcli.koopman.bases.polynomial import Tensor
from koopcli.koopman.edmd.blockwise import fit_blocks
from koopcli.koopman.edmd.inputs import white_inputs
from koopcli.koopman.edmd.passes import Over, here
from koopcli.koopman.edmd.product import fit_product
from koopcli.koopman.edmd.survey import Survey, survey
from koopcli.koopman.edmd.terms import LinearTerms, Terms
from koopcli.koopman.edmd.transitions import Transitions
from koopcli.koopman.predictor.coverage import Coverage, coverage_of
from koopcli.koopman.predictor.predictor import Predictor
from koopcli.koopman.predictor.regression import Regression
from koopcli.progress import Progress, silent
from koopcli.records import Trajectories

Data = Trajectories | Sequence[Trajectories] | Transitions


@dataclass(frozen=True)
class FitEdmd(Settings):
    """EDMD with inputs."""

    basis: BasisChoice = setting(Tensor(), option=True, help="family of observables")
    terms: Terms = setting(LinearTerms(), option=True, help="how inputs act")
    ridge: float = setting(
        0.0,
        low=0,
        high=1e6,
        option=True,
        help="penalty on the coefficients, of scaled columns; the constant and B stay free",
    )
    solver: Literal["orthonormal", "cholesky-monomials"] = setting(
        "orthonormal",
        option=True,
        help="least squares in an orthonormal basis; cholesky-monomials solves the textbook's normal equations "
        "instead, to show where their digits end",
    )
    chunk: int = setting(
        1_000_000, low=1, high=10**9, help="samples for each committed part of sums; a product dataset has none"
    )

    @property
    def plain(self) -> bool:
        """Whether the regression is the textbook's."""
        return self.solver == "cholesky-monomials"

    def basis_from(self, data: Data, seen: Survey | None = None) -> Basis:
        """The basis on the states that steps start from.

        A product dataset shows them once each; of very many others a spread choice shapes the basis, while the fit is
        over all of them. ``seen``: the survey of the data, if there is one already. Raises ``InvalidValueError`` for a
        state with too few different values.
        """
        pairs = Transitions.of(data)
        x = (seen or survey(pairs, here(pairs))).states
        channels, degrees = pairs.state_channels, self.basis.degrees(x.shape[1])
        for name, unit, values, degree in zip(channels.names, channels.units, x.T, degrees, strict=False):
            distinct = len(np.unique(values))
            if distinct <= degree:
                few = f"has {distinct} values" if distinct > 1 else f"is {values[0]:g} {unit} throughout"
                raise InvalidValueError(
                    f"{name} {few} in the training data, which carries polynomials up to degree {distinct - 1}, "
                    f"not {degree}: lower fit-edmd.order or fit-edmd.degree_velocity, or sample more values"
                )
        return self.basis.make(x, raw=self.plain)


def fit(
    data: Data,
    basis: Basis,
    how: FitEdmd = FitEdmd(),
    progress: Progress = silent,
    over: Over | None = None,
    seen: Survey | None = None,
) -> Predictor:
    """A, B and N_i of ψ(x⁺) ≈ A ψ(x) + B u + Σ_i u_i N_i ψ(x) by least squares over all one-step pairs (4.4), (4.6).

    ``basis``: ψ, which need not be the one that ``how`` chooses.
    C is exact. On a product dataset of one step ψ(x) takes few distinct values and ψ(x⁺) can be averaged over the
    inputs first, which is the same minimum for a fraction of the work (4.5); any other dataset is read in blocks, and
    so is every one by the solver ``cholesky-monomials``, which is to show what the plain method does. ``over`` runs
    passes over the samples where they are spread; ``seen``: the survey of the data, if there is one already.
    Raises ``InvalidValueError`` for fewer samples than unknowns and for data that are not finite.
    """
    pairs = Transitions.of(data)
    products = how.terms.products
    check_samples(len(pairs), basis.functions, len(pairs.input_channels), how.terms)
    over = over or here(pairs, progress)
    seen = seen or survey(pairs, over)
    product = pairs.product
    if product is not None and basis.constant is not None and not how.plain:
        operators = fit_product(product, seen, basis, products, how.ridge, progress)
    else:
        operators = fit_blocks(seen, basis, products, how.ridge, how.plain, over)
    return Predictor(
        observables=basis,
        dynamics=how.terms.dynamics(operators, basis.constant, pairs.dt),
        C=basis.state_map,
        dt=pairs.dt,
        coverage=coverage_of(seen.states, seen.corners),
        state_channels=pairs.state_channels,
        input_channels=pairs.input_channels,
        regression=Regression(operators.rank, operators.directions, operators.condition, operators.solved_by),
        plant=pairs.plant,
    )


def check_samples(samples: int, functions: int, inputs: int, terms: Terms) -> None:
    """Raise ``InvalidValueError`` for fewer ``samples`` than unknowns of each lifted state."""
    unknowns = terms.count(functions, inputs)
    if samples < unknowns:
        each = f", {unknowns} bilinear terms together" if terms.products else ""
        raise InvalidValueError(
            f"{samples} samples cannot determine {functions} functions and {inputs} inputs{each}: "
            "lower the order or the number of centres, or sample more"
        )


def why_deficient(data: Data, predictor: Predictor, seen: Survey | None = None) -> str:
    """What in the data leaves directions of a fit open, in words; nothing where it is their dependence alone."""
    pairs = Transitions.of(data)
    seen = seen or survey(pairs, here(pairs))
    causes = []
    x, functions = seen.states, predictor.functions
    distinct = len(np.unique(x, axis=0))
    if distinct < functions:
        causes.append(f"they hold {distinct} different states for {functions} functions")
    still = [name for name, values in zip(pairs.state_channels.names, x.T, strict=True) if not np.ptp(values)]
    if still:
        causes.append(f"{', '.join(still)} never changes")
    inputs = white_inputs(seen.triangle, seen.ends, centred=True)
    if inputs.T.shape[1] < inputs.moving.sum():
        causes.append("inputs move only together")
    return " and ".join(causes)


def coverage(data: Data, seen: Survey | None = None) -> Coverage:
    """Where the states lie that steps start from; those of a product count once."""
    pairs = Transitions.of(data)
    seen = seen or survey(pairs, here(pairs))
    return coverage_of(seen.states, seen.corners)
