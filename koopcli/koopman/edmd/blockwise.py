"""EDMD of any data, read in blocks: one pass of sums, and a second where these would lose too many digits."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from koopcli.koopman.bases.basis import Basis
from koopcli.koopman.edmd.inputs import white_inputs
from koopcli.koopman.edmd.operators import Operators, operators
from koopcli.koopman.edmd.passes import Over, Pass
from koopcli.koopman.edmd.regression import GRAM_CONDITION, Normal, Scaled, Solution, add_rows, cholesky
from koopcli.koopman.edmd.sums import Regressors, Sum, Triangle, lost_by, moments_pay, together
from koopcli.koopman.edmd.survey import Look, Survey
from koopcli.koopman.predictor.coverage import spread
from koopcli.records import Packed

TRIED = 8  # states for each function, of those that tell whether moments hold

PASSES: dict[str, Callable[[Packed], Pass]] = {"look": Look.unpack, "sum": Sum.unpack, "triangle": Triangle.unpack}


def fit_blocks(seen: Survey, basis: Basis, bilinear: bool, ridge: float, plain: bool, over: Over) -> Operators:
    """Least squares on the columns of :class:`Regressors`; ``plain``: by the textbook's normal equations as they are.

    ``over`` runs a pass over all samples, here or spread over many processes.
    """
    inputs = white_inputs(seen.triangle, seen.ends, centred=basis.constant is not None)
    columns = Regressors(basis, inputs, bilinear)
    layout, c = columns.layout, basis.constant
    functions, r = layout.functions, layout.directions
    free = [] if c is None else [c]
    if layout.inputs:
        free += range(functions, functions + layout.inputs)
    elif c is not None:
        free += [functions * (q + 1) + c for q in range(r)]
    solution = cholesky(together(over(Sum(columns)))) if plain else _least_squares(columns, seen, ridge, free, over)
    coefficients = solution.coefficients.T
    A, rest = coefficients[:, :functions], coefficients[:, functions:]
    B = rest[:, :r] if layout.inputs or not bilinear else None
    N = rest[:, layout.inputs :].reshape(functions, r, functions).transpose(1, 0, 2) if bilinear else None
    missing = int(inputs.moving.sum()) - r
    directions = layout.columns + missing * (functions if bilinear else 1)
    way = solution.solved_by
    return operators(A, B, N, inputs, basis, solution, rank=solution.rank, directions=directions, solved_by=way)


def _least_squares(columns: Regressors, seen: Survey, ridge: float, free: list[int], over: Over) -> Solution:
    """The quickest way that keeps the digits: the condition number of the normal equations decides, as measured.

    The ridge (4.7) leaves the columns ``free``: the constant and B, which the data determine well.
    """
    promising = moments_pay(columns) and _moments_hold(columns.basis, seen)
    ways = [(True, "moments")] if promising else []
    for by_moments, way in [*ways, (False, "normal equations")]:
        scaled = Scaled.of(together(over(Sum(columns, by_moments))), ridge, free)
        if scaled.harmless:
            return scaled.solution(way)
        if scaled.condition > GRAM_CONDITION:
            break  # however they are summed
    triangle = None
    for part in over(Triangle(columns, scaled.scale)):
        rows = part["triangle"]
        triangle = rows if triangle is None else add_rows(triangle, rows)
    assert triangle is not None, "there is at least one part"
    return scaled.by_triangle(triangle)


def _moments_hold(basis: Basis, seen: Survey) -> bool:
    """Whether the moments of some of the states keep the digits that their condition asks for: else a whole pass over
    the samples would be in vain.
    """
    assert basis.products is not None, "asked where there are"
    x = seen.states[spread(len(seen.states), TRIED * basis.functions)]
    z = basis.lift(x).T
    direct = z @ z.T
    (gram,) = basis.products.gram(basis.products.sums(x, np.ones((1, len(x)))))
    nothing = np.zeros((len(z), 0))
    return Scaled.of(Normal(direct, nothing, len(x), lost_by(gram, direct))).harmless
