"""What generic least squares makes of raw monomials, beside the orthonormal basis (docs/regression.md).

The rows of 202 500 samples are reduced to a triangle with the same singular values first, so that every solver sees
exactly the problem that it would see, in a fraction of the memory. ``make traps`` prints the table.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from koopcli.config.experiment import load_experiment
from koopcli.errors import InvalidValueError
from koopcli.koopman.edmd import fit as edmd
from koopcli.koopman.edmd.transitions import Transitions
from koopcli.koopman.predictor.predictor import Predictor
from koopcli.koopman.scores.evaluation import Evaluation, evaluate
from koopcli.records import FloatArray, Sample, Trajectories
from koopcli.simulation import sampling
from koopcli.simulation.integrate import simulate
from koopcli.simulation.samples.box import BoxSample
from koopcli.simulation.samples.grid import GridSample
from koopcli.vehicles.plants.forces import ForceInput

ORDERS = (5, 6, 7, 8)
EPS = float(np.finfo(float).eps)


def trajectories(sample: Sample, steps: int) -> Trajectories:
    """The paper's vehicle driven by forces."""
    plant = ForceInput(load_experiment("paper", {}).vehicle)
    x0, u = sample.expand(steps)
    x = simulate(plant.rhs, x0, u, 0.01)
    return Trajectories(x, u, 0.01, plant.states, plant.inputs, sample.product)


def dataset() -> Trajectories:
    """The training set, as the experiment has it."""
    s = GridSample()
    factors, u = sampling.grid(s.seed, s.box, s.count, s.draw, s.levels, s.columns, 4)
    return trajectories(Sample(factors, np.empty((0, 3)), u, True, ForceInput.states, ForceInput.inputs), 1)


def test_set(excitation: str) -> Trajectories:
    """The test set under fresh inputs or none."""
    s = BoxSample()
    x0, u = sampling.box(s.seed, s.box, s.count, excitation, s.amplitude, s.steps, 4)
    return trajectories(Sample((), x0, u, False, ForceInput.states, ForceInput.inputs), s.steps)


def triangle(data: Trajectories, order: int) -> tuple[FloatArray, FloatArray]:
    """V and Y of the regression on raw monomials and inputs, as many rows as columns."""
    basis = edmd.FitEdmd.of(basis="tensor", order=order, solver="cholesky-monomials").basis_from(data)
    kept = np.empty((0, 2 * basis.functions + len(data.input_channels)))
    for x, u, x_next in Transitions.of(data).blocks(16384):
        rows = np.hstack([basis.lift(x), u, basis.lift(x_next)])
        kept = np.linalg.qr(np.vstack([kept, rows]), mode="r")
    columns = basis.functions + len(data.input_channels)
    return kept[:, :columns], kept[:, columns:]


def lstsq(V: FloatArray, Y: FloatArray, rows: int) -> tuple[FloatArray, int]:
    """``numpy.linalg.lstsq`` with its default cut: working precision times the larger side of V."""
    W, _, rank, _ = np.linalg.lstsq(V, Y, rcond=EPS * rows)
    return W, int(rank)


def pinv_of_gram(V: FloatArray, Y: FloatArray, rows: int) -> tuple[FloatArray, int]:
    """``numpy.linalg.pinv`` of the normal equations, as the EDMD papers write it."""
    gram = V.T @ V
    singular = np.linalg.svd(gram, compute_uv=False)
    return np.linalg.pinv(gram) @ (V.T @ Y), int((singular > len(gram) * EPS * singular[0]).sum())


def solve_gram(V: FloatArray, Y: FloatArray, rows: int) -> tuple[FloatArray, int]:
    """``numpy.linalg.solve`` of the normal equations."""
    return np.linalg.solve(V.T @ V, V.T @ Y), V.shape[1]


SOLVERS: dict[str, Callable[[FloatArray, FloatArray, int], tuple[FloatArray, int]]] = {
    "lstsq, default cut": lstsq,
    "pinv of the normal equations": pinv_of_gram,
    "solve of the normal equations": solve_gram,
}


def main() -> None:
    """Print rank and error of every solver and order."""
    data, tests = dataset(), {kind: test_set(kind) for kind in ("none", "fresh")}
    print(f"{'order':>5}  {'solver':<30} {'rank':>11}  RMSE mean / median in %: no input, fresh inputs")

    def line(order: int, name: str, rank: int, columns: int, predictor: Predictor) -> None:
        scores = ", ".join(_score(evaluate(predictor, test, slice(None), 1)) for test in tests.values())
        print(f"{order:>5}  {name:<30} {f'{rank} of {columns}':>11}  {scores}", flush=True)

    for order in ORDERS:
        good = edmd.fit(data, edmd.FitEdmd.of(basis="tensor", order=order).basis_from(data))
        raw = edmd.FitEdmd.of(basis="tensor", order=order, solver="cholesky-monomials").basis_from(data)
        V, Y = triangle(data, order)
        N = raw.functions
        for name, solver in SOLVERS.items():
            W, rank = solver(V, Y, len(data))
            found = replace(good, observables=raw, A=W[:N].T.copy(), B=W[N:].T.copy(), C=raw.state_map)
            line(order, name, rank, V.shape[1], found)
        try:
            found = edmd.fit(data, raw, edmd.FitEdmd.of(solver="cholesky-monomials"))
            line(order, "cholesky-monomials", found.rank, V.shape[1], found)
        except InvalidValueError as error:
            print(f"{order:>5}  {'cholesky-monomials':<30} {error}")
        line(order, "orthonormal", good.rank, good.directions, good)


def _score(found: Evaluation) -> str:
    figures = found.figures()
    score = figures["rmse"]
    lost = f" ({figures['diverged']} diverge)" if figures["diverged"] else ""
    return f"{score['mean']:.4g} / {score['median']:.4g}{lost}"


if __name__ == "__main__":
    main()
