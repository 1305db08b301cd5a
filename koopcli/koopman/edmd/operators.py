"""From the coefficients of a regression on inputs of mean square one to A, B and N_i for the inputs themselves."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.koopman.bases.basis import Basis
from koopcli.koopman.edmd.inputs import WhiteInputs
from koopcli.koopman.edmd.regression import Solution, condition_number
from koopcli.records import FloatArray


class Operators(NamedTuple):
    """A (N, N), B (N, n_u) and the N_i (n_u, N, N) or None, with what is known of the regression behind them."""

    A: FloatArray
    B: FloatArray
    N: FloatArray | None
    rank: int
    directions: int
    condition: float
    solved_by: str


def operators(
    A: FloatArray,
    B: FloatArray | None,
    N: FloatArray | None,
    inputs: WhiteInputs,
    basis: Basis,
    solution: Solution,
    *,
    rank: int,
    directions: int,
    solved_by: str,
) -> Operators:
    """A, B (N, n_u), N (n_u, N, N) for u instead of w, each term in one place.

    ``A`` (N, N), ``B`` (N, r), ``N`` (r, N, N) are those of w; without ``B`` the constant's column of ``N`` holds it.
    What the mean input adds goes into A, and the constant's products with an input into B.
    """
    A, c = A.copy(), basis.constant
    in_B = np.zeros((len(A), len(inputs.mean))) if B is None else B @ inputs.T.T
    terms = None if N is None else np.tensordot(inputs.T, N, axes=1)
    if terms is not None:
        A -= np.tensordot(inputs.mean, terms, axes=1)
        if c is not None:
            in_B = in_B + terms[:, :, c].T
            terms[:, :, c] = 0.0
    if c is not None and B is not None:
        A[:, c] -= in_B @ inputs.mean
    for matrix in (A, in_B, terms):
        if matrix is not None and not np.isfinite(matrix).all():
            raise InvalidValueError("the regression left the finite numbers: lower the order, or use a --ridge")
    condition = condition_number(np.concatenate([solution.singular_values, inputs.singular]))
    return Operators(A, in_B, terms, rank, directions, condition, solved_by)
