"""Extended dynamic mode decomposition with inputs (docs/equations.md 4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.koopman.bases import BASES, Basis, Choice
from koopcli.koopman.edmd.blockwise import fit_blocks
from koopcli.koopman.edmd.generator import generator_of
from koopcli.koopman.edmd.inputs import white_inputs
from koopcli.koopman.edmd.operators import Operators
from koopcli.koopman.edmd.passes import Over, here
from koopcli.koopman.edmd.product import fit_product
from koopcli.koopman.edmd.survey import Survey, survey
from koopcli.koopman.edmd.transitions import Transitions
from koopcli.koopman.predictor.coverage import Coverage, coverage_of
from koopcli.koopman.predictor.dynamics import Dynamics
from koopcli.koopman.predictor.dynamics.bilinear import Bilinear
from koopcli.koopman.predictor.dynamics.generator import Generator
from koopcli.koopman.predictor.dynamics.linear import Linear
from koopcli.koopman.predictor.predictor import Predictor
from koopcli.koopman.predictor.regression import Regression
from koopcli.progress import Progress, silent
from koopcli.records import Trajectories

Data = Trajectories | Sequence[Trajectories] | Transitions


@dataclass(frozen=True)
class Method:
    """How the regression is done: with ``bilinear`` terms u_i N_i z or without, these with the ``generator`` of the
    step or without, with a ``ridge`` (4.7), and whether by the plain normal equations of ``cholesky``.
    """

    bilinear: bool = False
    ridge: float = 0.0
    cholesky: bool = False
    generator: bool = False


def basis_from_data(data: Data, choice: Choice, seen: Survey | None = None) -> Basis:
    """The basis of a ``choice`` on the states that steps start from.

    A product dataset shows them once each; of very many others a spread choice shapes the basis, while the fit is over
    all of them. ``seen``: the survey of the data, if there is one already. Raises ``InvalidValueError`` for a state
    with too few different values.
    """
    pairs = Transitions.of(data)
    x = (seen or survey(pairs, here(pairs))).states
    channels = pairs.state_channels
    for name, unit, values, degree in zip(
        channels.names, channels.units, x.T, BASES[choice.kind].degrees(choice, x.shape[1]), strict=False
    ):
        distinct = len(np.unique(values))
        if distinct <= degree:
            what = f"{name} is {values[0]:g} {unit} throughout" if distinct == 1 else f"{name} has {distinct} values"
            raise InvalidValueError(
                f"{what} in the training data, which carries polynomials up to degree {distinct - 1}, not {degree}: "
                "lower fit-edmd.order or fit-edmd.degree_velocity, or sample more values"
            )
    return BASES[choice.kind].make(x, choice)


def fit(
    data: Data,
    basis: Basis,
    method: Method = Method(),
    progress: Progress = silent,
    over: Over | None = None,
    seen: Survey | None = None,
) -> Predictor:
    """A, B and N_i of ψ(x⁺) ≈ A ψ(x) + B u + Σ_i u_i N_i ψ(x) by least squares over all one-step pairs (4.4), (4.6).

    C is exact. On a product dataset of one step ψ(x) takes few distinct values and ψ(x⁺) can be averaged over the
    inputs first, which is the same minimum for a fraction of the work (4.5); any other dataset is read in blocks, and
    so is every one by ``cholesky``, which is to show what the plain method does. ``over`` runs passes over the samples
    where they are spread; ``seen``: the survey of the data, if there is one already.
    Raises ``InvalidValueError`` for fewer samples than unknowns and for data that are not finite.
    """
    pairs = Transitions.of(data)
    check_samples(len(pairs), basis.functions, len(pairs.input_channels), bilinear=method.bilinear)
    over = over or here(pairs, progress)
    seen = seen or survey(pairs, over)
    product = pairs.product
    if product is not None and basis.constant is not None and not method.cholesky:
        found = fit_product(product, seen, basis, method.bilinear, method.ridge, progress)
    else:
        found = fit_blocks(seen, basis, method.bilinear, method.ridge, method.cholesky, over)
    return Predictor(
        observables=basis,
        dynamics=_dynamics(found, method, basis.constant, pairs.dt),
        C=basis.state_map,
        dt=pairs.dt,
        coverage=coverage_of(seen.states, seen.corners),
        state_channels=pairs.state_channels,
        input_channels=pairs.input_channels,
        regression=Regression(found.rank, found.directions, found.condition, found.solved_by),
        plant=pairs.plant,
    )


def _dynamics(found: Operators, method: Method, constant: int | None, dt: float) -> Dynamics:
    """Linear, bilinear or by a generator."""
    if found.N is None:
        return Linear(found.A, found.B)
    if not method.generator:
        return Bilinear(found.A, found.B, found.N)
    assert constant is not None, "a basis without a constant is refused by whoever chooses it"
    return Generator(generator_of(found.A, found.B, found.N, constant, dt), dt)


def check_samples(samples: int, functions: int, inputs: int, *, bilinear: bool) -> None:
    """Raise ``InvalidValueError`` for fewer ``samples`` than unknowns of each lifted state."""
    unknowns = functions * (1 + inputs) if bilinear else functions + inputs
    if samples < unknowns:
        each = f", {unknowns} bilinear terms together" if bilinear else ""
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
