"""One measured task in a process of its own: ``python benchmarks/tasks.py TASK STORE`` prints its figures as JSON.

CPU seconds are of the work alone, without imports and reading; the memory is the peak of the whole process.
"""

from __future__ import annotations

import json
import resource
import sys
import time
from pathlib import Path

import numpy as np
import plain

import koopcli
from koopcli.koopman.edmd import fit as edmd
from koopcli.koopman.scores.evaluation import evaluate, join

ORDER = 7


def cpu() -> float:
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


def fit_product(store: Path):
    data = koopcli.load("simulate", store)
    yield
    basis = edmd.FitEdmd.of(basis="tensor", order=ORDER).basis_from(data)
    predictor = edmd.fit(data, basis)
    yield float(np.abs(predictor.dynamics.A).sum())


def fit_blocks(store: Path):
    from dataclasses import replace

    from scipy.spatial import ConvexHull  # noqa: F401  (imports aside)

    data = replace(koopcli.load("simulate", store), product=None)
    yield
    basis = edmd.FitEdmd.of(basis="tensor", order=ORDER).basis_from(data)
    predictor = edmd.fit(data, basis)
    yield float(np.abs(predictor.dynamics.A).sum())


def fit_bilinear(store: Path):
    data = koopcli.load("simulate", store)
    yield
    yield float(np.abs(_bilinear(data).dynamics.N).sum())


def fit_bilinear_blocks(store: Path):
    from dataclasses import replace

    from scipy.spatial import ConvexHull  # noqa: F401  (imports aside)

    data = replace(koopcli.load("simulate", store), product=None)
    yield
    yield float(np.abs(_bilinear(data).dynamics.N).sum())


def _bilinear(data):
    basis = edmd.FitEdmd.of(basis="anisotropic", order=8).basis_from(data)
    return edmd.fit(data, basis, edmd.FitEdmd.of(terms="bilinear"))


def bilinear_prediction(store: Path):
    """All trajectories of the test set, rolled together."""
    predictor, test = _bilinear(koopcli.load("simulate", store)), koopcli.load("simulate", store / "test")
    x0, u = test.x[:, 0], test.u[:]
    yield
    yield float(np.abs(predictor.predict(x0, u)).sum())


def bilinear_loop(store: Path):
    """The same, one trajectory and one input at a time."""
    predictor, test = _bilinear(koopcli.load("simulate", store)), koopcli.load("simulate", store / "test")
    x0, u = test.x[:, 0], test.u[:]
    yield
    total = float(np.abs(x0).sum())
    for start, inputs in zip(predictor.lift(x0), u, strict=True):
        z = start
        for now in inputs:
            z = (
                predictor.dynamics.A @ z
                + predictor.dynamics.B @ now
                + sum(v * (N @ z) for v, N in zip(now, predictor.dynamics.N, strict=True))
            )
            total += float(np.abs(predictor.C @ z).sum())
    yield total


def fit_plain(store: Path):
    data = koopcli.load("simulate", store)
    basis = edmd.FitEdmd.of(basis="tensor", order=ORDER).basis_from(data)
    x, u = data.x[:], data.u[:]
    yield
    A, _ = plain.fit(x[:, 0], u[:, 0], x[:, 1], basis.lift)
    yield float(np.abs(A).sum())


def evaluation(store: Path):
    from scipy.spatial import cKDTree  # noqa: F401  (imports aside)

    predictor, test = koopcli.load("fit-edmd", store), koopcli.load("simulate", store / "test")
    yield
    parts = [evaluate(predictor, test, slice(i, i + 2048), 1) for i in range(0, len(test), 2048)]
    yield join(parts).figures()["rmse"]["mean"]


def slips(store: Path):
    from koopcli.simulation.integrate import simulate
    from koopcli.vehicles.plants import remembered_plant

    data = koopcli.load("simulate", store)
    plant, x0, u = remembered_plant(data.plant), data.x[:, 0], data.u[:]
    yield
    yield float(np.abs(simulate(plant.rhs, x0, u, data.dt, fastest_rate=plant.fastest_rate)).sum())


def eigen_fit(store: Path):
    from scipy.linalg import expm  # noqa: F401  (imports aside)
    from scipy.spatial import ConvexHull  # noqa: F401

    from koopcli.config.settings import FitEigen
    from koopcli.koopman.eigen.fit import fit
    from koopcli.stages.fit_eigen import reading

    data = koopcli.load("simulate", store)
    yield
    predictor = fit(data, reading(FitEigen().settled(), data.steps, data.dt))
    yield float(predictor.regression.rank)


def eigen_dense(store: Path):
    """A tenth of the trajectories and splines as one dense least squares: a hundredth of the unknowns' cost."""
    from koopcli.koopman.bases.thin_plate import draw_centres, thin_plate
    from koopcli.koopman.eigen.rates.dmd import dmd_rates, lattice
    from koopcli.koopman.predictor.modes import exponentials

    data = koopcli.load("simulate", store)
    x = data.x[::10]
    yield
    rates = lattice(dmd_rates(x, data.dt), 2)
    V = exponentials(rates, data.dt * np.arange(float(x.shape[1])))
    g = thin_plate(x[:, 0], draw_centres(x, 44, 0), np.ones(3))
    W = np.kron(g, V)
    yield float(np.linalg.lstsq(W / np.linalg.norm(W, axis=0), x.reshape(-1, 3), rcond=1e-14)[2])


def eigen_evaluation(store: Path):
    from scipy.linalg import expm  # noqa: F401  (imports aside)
    from scipy.spatial import cKDTree  # noqa: F401

    predictor, test = koopcli.load("fit-eigen", store), koopcli.load("simulate", store / "test")
    yield
    yield evaluate(predictor, test, slice(None), 0).figures()["rmse"]["mean"]


def _nodes_and_queries(store: Path):
    """The samples of the first second of every trajectory, each once, and 2 000 test states, in semi-axes."""
    data, test = koopcli.load("simulate", store), koopcli.load("simulate", store / "test")
    x = np.asarray(data.x)
    size = np.abs(x).max(axis=(0, 1))
    nodes = np.unique(np.round(x[:, :101].reshape(-1, 3) / size, 9), axis=0)
    return nodes, np.asarray(test.x)[:, 0] / size


def _in_a_ball(store: Path):
    """9 000 nodes in the volume, as the thinned samples of a greedy design lie, and the same test states."""
    from koopcli.simulation.sampling import ball

    return ball(0, 9000), 0.95 * _nodes_and_queries(store)[1]


def _futures(nodes):
    """As many values at each node as a half second of three states has."""
    return np.sin(nodes @ np.random.default_rng(0).standard_normal((3, 153)))


def _looked_up(kind: str, nodes, queries):
    from scipy.sparse import csr_matrix

    from koopcli.koopman.eigen.lookup.cloud import Cloud
    from koopcli.koopman.eigen.lookup.lookup import Lift

    numbers = np.arange(len(nodes))
    found = Lift.kinds()[kind]().make(Cloud(nodes, numbers, numbers, Lift.kinds()[kind]().neighbours))
    found(queries[:1])
    values = _futures(nodes)
    yield
    indices, weights = found(queries)
    ends = np.arange(len(queries) + 1) * indices.shape[1]
    yield float((csr_matrix((weights.ravel(), indices.ravel(), ends), shape=(len(queries), len(nodes))) @ values).sum())


def walk(store: Path):
    yield from _looked_up("linear", *_nodes_and_queries(store))


def splines(store: Path):
    yield from _looked_up("polyharmonic", *_in_a_ball(store))


def find_simplex(store: Path):
    """The same as `walk` by scipy's own search, which first prepares every simplex."""
    from scipy.spatial import Delaunay, cKDTree

    nodes, queries = _nodes_and_queries(store)
    triangulation, tree, values = Delaunay(nodes), cKDTree(nodes), _futures(nodes)
    yield
    found = triangulation.find_simplex(queries)
    T = triangulation.transform[found]
    b = np.einsum("nij,nj->ni", T[:, :3], queries - T[:, 3])
    weights = np.column_stack([b, 1 - b.sum(axis=1)])
    indices = triangulation.simplices[found]
    out = found < 0
    indices[out], weights[out] = tree.query(queries[out])[1][:, np.newaxis], [1, 0, 0, 0]
    yield float((weights[..., np.newaxis] * values[indices]).sum())


def rbf(store: Path):
    """The same as `splines` by scipy's interpolator, a loop over the places."""
    from scipy.interpolate import RBFInterpolator

    nodes, queries = _in_a_ball(store)
    values = _futures(nodes)
    yield
    found = RBFInterpolator(nodes, values, neighbors=60, kernel="cubic", degree=2)(queries)
    yield float(found.sum())


def lift_one(store: Path):
    """200 states, one after another, as a controller would ask."""
    lift, x = _lift_and_states(store)
    yield
    yield sum(float(lift(x[i : i + 1]).sum()) for i in range(200))


def lift_many(store: Path):
    """2 000 states at once."""
    lift, x = _lift_and_states(store)
    yield
    yield float(lift(x).sum())


def _lift_and_states(store: Path):
    """The lift of the predictor in the ``store``, and states drawn as those of a test set are."""
    from koopcli.simulation import sampling

    lift = koopcli.load("fit-eigen", store).observables
    x = sampling.ball(0, 2000) * np.abs(lift.nodes.states).max(axis=0)
    lift.lift(x[:1])
    return lift.lift, x


def dgemm(store: Path):
    """The product of two matrices of 2 000 × 2 000."""
    a = np.random.default_rng(0).normal(size=(2000, 2000))
    a[:10] @ a
    yield
    yield float((a @ a).sum())


TASKS = {
    "lift-one": lift_one,
    "lift-many": lift_many,
    "dgemm": dgemm,
    "fit-product": fit_product,
    "fit-blocks": fit_blocks,
    "fit-plain": fit_plain,
    "fit-bilinear": fit_bilinear,
    "fit-bilinear-blocks": fit_bilinear_blocks,
    "bilinear-prediction": bilinear_prediction,
    "bilinear-loop": bilinear_loop,
    "evaluation": evaluation,
    "slips": slips,
    "eigen-fit": eigen_fit,
    "eigen-dense": eigen_dense,
    "eigen-evaluation": eigen_evaluation,
    "walk": walk,
    "find-simplex": find_simplex,
    "splines": splines,
    "rbf": rbf,
}


if __name__ == "__main__":
    steps = TASKS[sys.argv[1]](Path(sys.argv[2]))
    next(steps)
    begin, clock = cpu(), time.perf_counter()
    result = next(steps)
    figures = {
        "cpu": cpu() - begin,
        "wall": time.perf_counter() - clock,
        "memory": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        "result": result,
    }
    print(json.dumps(figures))
