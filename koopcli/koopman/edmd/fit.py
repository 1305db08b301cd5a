"""Extended dynamic mode decomposition with inputs (docs/equations.md 4)."""

from __future__ import annotations

import math
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
from koopcli.koopman.edmd.increments import RIDGE, fit_increments
from koopcli.koopman.edmd.inputs import white_inputs
from koopcli.koopman.edmd.passes import Over, here
from koopcli.koopman.edmd.product import fit_product
from koopcli.koopman.edmd.survey import Survey, survey
from koopcli.koopman.edmd.terms import LinearTerms, Terms
from koopcli.koopman.edmd.transitions import Record, Transitions
from koopcli.koopman.predictor.coverage import Coverage, coverage_of
from koopcli.koopman.predictor.predictor import Predictor
from koopcli.koopman.predictor.regression import Regression
from koopcli.progress import Progress, silent

Data = Record | Sequence[Record] | Transitions
MEMORY = 0.2  # s of measured data, unless another is asked for
WHOLE = 1e-3  # of a step: by so much a memory may be off a whole number of them


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
    memory: float | None = setting(
        None,
        low=0,
        high=1e3,
        unit="s",
        option=True,
        help="past states and inputs in the lift; left out, 0.2 s of measured data and none of simulated ones",
    )
    increment_ridge: float | None = setting(
        None,
        low=0,
        high=1e6,
        option=True,
        help="penalty of measured data, of a memory and of the terms products, in place of --ridge: it draws a fit "
        f"towards a state that is held; left out, {RIDGE:g}",
    )

    @property
    def by_increments(self) -> bool:
        """Whether simulated data are fitted as measured ones are: what it takes for a memory and for ``products``."""
        return bool(self.memory) or self.terms.of_states

    @property
    def held_by(self) -> float:
        """The ridge of increments that is in effect."""
        return RIDGE if self.increment_ridge is None else self.increment_ridge

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


MEASURED = FitEdmd.of(basis="total", order=1)  # how measured data are fitted, unless settings say otherwise


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
    passes over the samples where they are spread; ``seen``: the survey of the data, if there is one already. With a
    memory, or products with the states alone, it is :func:`koopcli.koopman.edmd.increments.fit_increments` on that
    basis. Raises ``InvalidValueError`` for fewer samples than unknowns and for data that are not finite.
    """
    pairs = Transitions.of(data)
    products = how.terms.products
    if how.by_increments:
        check_increments(how)
        steps = memory_steps(how.memory or 0.0, pairs)
        return fit_increments(pairs, basis, steps, products, how.held_by, progress)
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


def fit_measured(episodes: Data, how: FitEdmd = MEASURED, progress: Progress = silent) -> Predictor:
    """The predictor that ``how`` asks for of measured ``episodes``: increments regressed on states, inputs and their
    past (:mod:`koopcli.koopman.edmd.increments`).

    Without a memory it is ``MEMORY`` s, as a whole number of steps and one at least. Raises ``InvalidValueError`` for a
    memory that is no whole number of steps or longer than every episode, for settings that measured data are not
    fitted with, and as ``fit_increments``.
    """
    check_increments(how)
    pairs = Transitions.of(episodes)
    steps = max(1, round(MEMORY / pairs.dt)) if how.memory is None else memory_steps(how.memory, pairs)
    return fit_increments(pairs, how.basis, steps, how.terms.products, how.held_by, progress)


def memory_steps(memory: float, data: Data) -> int:
    """The steps of a ``memory`` in s. Raises ``InvalidValueError`` where it is no whole number of them."""
    dt = Transitions.of(data).dt
    steps = round(memory / dt)
    if abs(memory / dt - steps) > WHOLE:
        below, above = (f"{n * dt:g}" for n in (math.floor(memory / dt), math.ceil(memory / dt)))
        raise InvalidValueError(
            f"'fit-edmd.memory' {memory:g} s is no whole number of steps of {dt:g} s: choose {below} or {above}"
        )
    return steps


def check_increments(how: FitEdmd) -> None:
    """Raise ``InvalidValueError`` for settings that a fit of increments has no use for."""
    if how.terms.products and not how.terms.of_states:
        raise InvalidValueError(
            f"the terms '{how.terms.kind}' multiply inputs with past states too, which grows without bound on measured "
            "data: use --terms products or linear"
        )
    if how.ridge > 0:
        raise InvalidValueError(
            f"'fit-edmd.ridge' {how.ridge:g} draws a fit towards zero, and this one is drawn towards a state that is "
            "held: set fit-edmd.increment_ridge"
        )
    if how.plain:
        raise InvalidValueError(
            "the solver 'cholesky-monomials' is for simulated data without a memory: use the solver 'orthonormal'"
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
