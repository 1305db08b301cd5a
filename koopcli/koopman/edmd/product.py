"""EDMD of a product dataset: the exact least squares for a fraction of the work (docs/equations.md 4.5)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from koopcli.koopman.bases.basis import Basis
from koopcli.koopman.edmd.inputs import white_inputs
from koopcli.koopman.edmd.operators import Operators, operators
from koopcli.koopman.edmd.regression import least_squares
from koopcli.koopman.edmd.survey import Survey
from koopcli.progress import Progress
from koopcli.records import FloatArray, Trajectories

BLOCK = 4096  # states lifted together


def fit_product(
    trajectories: Trajectories, seen: Survey, basis: Basis, bilinear: bool, ridge: float, progress: Progress
) -> Operators:
    """The minimum over all pairs from the mean and the slopes of ψ(x⁺) over the inputs of each state.

    The inputs w of mean zero are orthogonal to every ψ(x), so A and B separate; of mean square I they are to one
    another, so every N_i is a regression of its own slopes.
    """
    x, columns = seen.states, seen.columns
    assert columns is not None, "a survey of a product has them"
    states, m = len(x), len(columns)
    inputs = white_inputs(seen.triangle, seen.ends, centred=True)
    weights = np.column_stack([np.ones(m), inputs(columns)]) / m
    functions, r = basis.functions, inputs.T.shape[1]
    slope = np.zeros((r, functions))
    few = max(1, BLOCK // m)  # states whose successors are lifted together

    def rows() -> Iterator[tuple[FloatArray, FloatArray]]:
        slope[:] = 0
        for start in range(0, states, BLOCK):
            stop = min(start + BLOCK, states)
            targets = np.empty((stop - start, functions * (1 + r if bilinear else 1)))
            for first in range(start, stop, few):
                last = min(first + few, stop)
                x_next = trajectories.x[first * m : last * m][:, 1].reshape(last - first, m, -1)
                moments = basis.group_moments(x_next, weights)
                wanted = moments if bilinear else moments[:, 0]
                targets[first - start : last - start] = wanted.reshape(last - first, -1)
                slope[:] += moments[:, 1:].sum(axis=0)
                progress(last, states)
            yield basis.lift(x[start:stop]), targets

    assert basis.constant is not None, "whoever chooses this way sees to it"
    solution = least_squares(rows, ridge, [basis.constant])
    A = solution.coefficients[:, :functions].T
    B = N = None
    if bilinear:
        N = solution.coefficients[:, functions:].reshape(functions, r, functions).transpose(1, 2, 0)
    else:
        B = slope.T / states
    each = functions if bilinear else 1
    directions = functions + each * int(inputs.moving.sum())
    rank = solution.rank * (1 + r) if bilinear else solution.rank + r
    way = "averages" if solution.solved_by == "normal equations" else f"averages, {solution.solved_by}"
    return operators(A, B, N, inputs, basis, solution, rank=rank, directions=directions, solved_by=way)
