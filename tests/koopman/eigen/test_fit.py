from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import mpmath as mp
import numpy as np
import pytest
from scipy.linalg import expm

from koopcli.config.data import locate
from koopcli.errors import InvalidValueError
from koopcli.koopman import stored
from koopcli.koopman.bases.thin_plate import draw_centres, thin_plate
from koopcli.koopman.edmd import fit as edmd
from koopcli.koopman.eigen.rates.dmd import Dmd, dmd_rates, lattice
from koopcli.koopman.eigen.rates.rates import check_growth
from koopcli.koopman.predictor.modes import exponentials
from koopcli.koopman.scores.baselines import FORECASTS, Forecast
from koopcli.koopman.scores.evaluation import evaluate
from koopcli.records import Channels, Trajectories
from koopcli.vehicles.parameters import read_vehicle
from koopcli.vehicles.plants.slips import SlipInput
from tests.conftest import ball_of, eigen_fit, grid_sample, surface_of, trajectories_of

REFERENCE = json.loads((Path(__file__).parents[2] / "golden" / "eigen_reference.json").read_text())


def linear(F, x0, steps, dt=0.01) -> Trajectories:
    """Trajectories of ẋ = F x."""
    x = np.empty((len(x0), steps + 1, len(F)))
    x[:, 0] = x0
    for k in range(steps):
        x[:, k + 1] = x[:, k] @ expm(F * dt).T
    names = tuple(f"x_{i}" for i in range(len(F)))
    channels = Channels(names, ("1",) * len(F))
    return Trajectories(x, np.zeros((len(x0), steps, 1)), dt, channels, Channels(("u",), ("1",)))


@pytest.fixture(scope="module")
def spiral():
    """A linear system with one pair of complex rates and a real one."""
    T = np.array([[1.0, 2.0, 0.5], [0.0, 1.0, 1.0], [0.3, 0.0, 1.0]])
    F = T @ np.array([[-1.0, -4.0, 0], [4.0, -1.0, 0], [0, 0, -2.0]]) @ np.linalg.inv(T)
    x0 = np.random.default_rng(0).standard_normal((25, 3))
    return linear(F, x0 / np.linalg.norm(x0, axis=1, keepdims=True), 60)


# --- rates


def test_dmd_recovers_the_rates_of_a_linear_system(spiral):
    found = np.sort_complex(dmd_rates(spiral.x, 0.01))
    assert found == pytest.approx(np.array([-2.0, -1 - 4j, -1 + 4j]), abs=1e-9)


def test_rates_that_no_system_in_continuous_time_has():
    x = np.array([[[1.0, 2.0], [-0.5, 1.0], [0.25, 0.5]], [[0.3, 1.0], [-0.15, 0.5], [0.075, 0.25]]])
    with pytest.raises(InvalidValueError, match=r"the eigenvalue -0\.5, which no continuous rate has"):
        dmd_rates(x, 0.01)


@pytest.mark.parametrize(("degree", "size"), [(0, 1), (1, 4), (2, 10), (3, 20)])
def test_the_lattice(degree, size):
    rates = np.array([-0.466, -1.053, -1.329], dtype=complex)
    found = lattice(rates, degree)
    assert len(found) == size == Dmd(degree).count(3)
    sums = {
        round(float((np.array([a, b, c]) * rates.real).sum()), 9)
        for a in range(degree + 1)
        for b in range(degree + 1)
        for c in range(degree + 1)
        if a + b + c <= degree
    }
    assert {round(value, 9) for value in found.real} == sums
    assert not found.imag.any()
    assert found[0] == 0


def test_a_complex_lattice_comes_in_pairs_and_names_equal_sums_once():
    found = lattice(np.array([-1 + 5j, -1 - 5j, -2.0]), 2)
    for i, rate in enumerate(found):
        if rate.imag > 0:
            assert found[i + 1] == rate.conjugate()
    assert np.abs(found[:, None] - found[None] + np.eye(len(found))).min() > 1e-9
    assert (found == -2).sum() == 1  # -2 itself and (-1 + 5i) + (-1 - 5i) are one value
    assert len(found) == 9


def test_growth_beyond_the_floating_point_range_is_refused():
    check_growth(np.array([-1e6, 100.0]), 1.5)
    with pytest.raises(InvalidValueError, match=r"the rate 200 1/s makes exp\(rate · time\) overflow within 1\.5 s"):
        check_growth(np.array([-1.0, 200.0]), 1.5)
    growing = linear(np.array([[20.0]]), np.array([[1.0], [-2.0], [0.5]]), 61)
    with pytest.raises(InvalidValueError, match=r"the rate 1200 1/s makes .* within 0\.61 s: lower fit-eigen\.degree"):
        eigen_fit(growing, **{"degree": 60, "tabulated": 5, "centres": 3})


# --- boundary functions


def test_thin_plate_by_hand():
    g = thin_plate(np.array([[1.0, 2.0, 2.0], [0.0, 0.0, 0.0]]), np.zeros((1, 3)), np.ones(3))
    assert g[:, 0] == pytest.approx([9 * np.log(3), 0.0])
    scaled = thin_plate(np.array([[2.0, 0.0, 0.0]]), np.zeros((1, 3)), np.array([4.0, 1.0, 1.0]))
    assert scaled[0, 0] == pytest.approx(0.25 * np.log(0.5))


def test_the_centres_are_drawn_as_written_down(spiral):
    flat = spiral.x.reshape(-1, 3)
    expected = flat.mean(0) + flat.std(0) * np.random.default_rng(5).standard_normal((7, 3))
    assert draw_centres(spiral.x, 7, 5) == pytest.approx(expected, rel=1e-15)


# --- the fit


def few(boundary: str, centres: int) -> dict[str, int]:
    return {"centres": centres} if boundary == "thin-plate" else {}


@pytest.mark.parametrize("boundary", ["optimal", "thin-plate"])
def test_a_linear_system_is_predicted_exactly(spiral, boundary):
    """Its states are eigenfunctions of degree one, and 25 splines can take any values on 25 initial states."""
    predictor = eigen_fit(spiral, **{"degree": 1, "boundary": boundary, "tabulated": 30, **few(boundary, 60)})
    assert predictor.horizon == 30
    for k in (0, 7, 30):
        found = predictor.predict(spiral.x[:, k], steps=30)
        assert found == pytest.approx(spiral.x[:, k : k + 31], abs=1e-7 if boundary == "thin-plate" else 1e-11)


@pytest.mark.parametrize("boundary", ["optimal", "thin-plate"])
def test_the_fit_is_the_least_squares_solution_written_out(spiral, boundary):
    """Against numpy's own on the whole Kronecker product, with values of x that no exponential fits."""
    rng = np.random.default_rng(1)
    x = np.array(spiral.x) + 0.1 * rng.standard_normal(spiral.x.shape)
    data = replace(spiral, x=x)
    predictor = eigen_fit(
        data, **{"degree": 1, "boundary": boundary, "tabulated": 40, "cut": 1e-13, **few(boundary, 6)}
    )
    V = exponentials(predictor.dynamics.modes.rates, 0.01 * np.arange(61.0))
    if boundary == "optimal":
        expected = np.einsum("kl,jls->jks", V, np.linalg.pinv(V) @ x)
    else:
        g = thin_plate(x[:, 0], draw_centres(x, 6, 0), np.ones(3))
        W = np.kron(g, V)
        expected = (W @ np.linalg.lstsq(W, x.reshape(-1, 3), rcond=None)[0]).reshape(x.shape)
    assert predictor.regression.rank == predictor.regression.directions
    for j in range(0, 25, 5):
        assert predictor.predict(x[j, 0], steps=20) == pytest.approx(expected[j, :21], abs=1e-9)
        assert predictor.predict(x[j, 40], steps=20) == pytest.approx(expected[j, 40:], abs=1e-9)


def test_complex_rates_at_a_tabulated_sample(spiral):
    """z is carried on by A, and A by e^{λt}: C A^k from sample k0 is the fit at k0 + k."""
    predictor = eigen_fit(spiral, **{"degree": 2, "boundary": "optimal", "tabulated": 30, "cut": 1e-9})
    assert (predictor.dynamics.modes.rates.imag != 0).any()
    start = predictor.predict(spiral.x[:, 0], steps=30)
    assert predictor.predict(spiral.x[:, 12], steps=18) == pytest.approx(start[:, 12:], abs=1e-9)


def test_it_survives_storage(spiral):
    predictor = eigen_fit(spiral, **{"degree": 1, "tabulated": 30, "centres": 9, "cut": 1e-12})
    again = stored.predictor(predictor.pack())
    assert again.horizon == 30
    assert (again.predict(spiral.x[:, 3], steps=5) == predictor.predict(spiral.x[:, 3], steps=5)).all()
    packed = predictor.pack().arrays
    assert "A" not in packed  # never as a matrix
    assert packed["rates"].values.shape == (4, 2)
    assert packed["A/block"].values.shape == (4, 4)


def test_past_the_window_is_refused_with_the_longest_allowed(spiral):
    predictor = eigen_fit(spiral, **{"degree": 1, "tabulated": 30, "centres": 9, "cut": 1e-12})
    with pytest.raises(InvalidValueError, match=r"31 steps are past the window .* may be asked for 30 at most"):
        predictor.predict(spiral.x[:, 0], steps=31)


def test_what_the_data_must_be(spiral, plant):
    with pytest.raises(InvalidValueError, match=r"inputs of these trajectories change or differ \(trajectory 1\)"):
        eigen_fit(trajectories_of(plant, grid_sample(count=3, columns=2), 5), **{"tabulated": 2})
    moving = np.zeros(spiral.u.shape)
    moving[4, 10:] = 0.1
    with pytest.raises(InvalidValueError, match=r"\(trajectory 4\)"):
        eigen_fit(replace(spiral, u=moving), **{"tabulated": 30})
    eigen_fit(replace(spiral, u=np.full(spiral.u.shape, 0.1)), **{"tabulated": 30, "centres": 5})  # one for all
    x = np.array(spiral.x)
    x[2, 3] = np.nan
    with pytest.raises(InvalidValueError, match="trajectory 2 holds values that are not finite"):
        eigen_fit(replace(spiral, x=x), **{"tabulated": 30})
    with pytest.raises(
        InvalidValueError, match=r"'fit-eigen.tabulate' of 0\.6 s leaves nothing of trajectories of 0\.6"
    ):
        eigen_fit(spiral, **{"tabulated": 60})
    with pytest.raises(InvalidValueError, match=r"84 rates are too many for windows of 60 steps"):
        eigen_fit(spiral, **{"tabulated": 30, "degree": 6})


# --- at the paper's size


@pytest.fixture(scope="module")
def full():
    """Training and test trajectories at full size, each made once."""
    made = {}

    def obtain(vehicle, peak=None, steps=150, seed=None):
        key = (vehicle, peak, steps, seed)
        if key not in made:
            parameters = read_vehicle(locate("vehicles", vehicle, "vehicle"))
            if peak is not None:
                tyre = replace(parameters.lateral, mu=peak / (parameters.m * 9.81 / 4))
                parameters = replace(parameters, lateral=tyre)
            plant = SlipInput(parameters)
            sample = surface_of(plant, 441) if seed is None else ball_of(plant, 2000, seed)
            made[key] = trajectories_of(plant, sample, steps if seed is None else 50)
        return made[key]

    return obtain


def usual(row):
    """Whether a row of the reference is of the trajectories that most rows are of; the paper's own has a test."""
    return (
        row["fit"] and row["vehicle"] == "ctu-2020" and not row.keys() & {"peak", "steps"} and row.get("seed", 0) == 0
    )


@pytest.mark.parametrize(
    "row",
    [row if usual(row) else pytest.param(row, marks=pytest.mark.slow) for row in REFERENCE["rows"]],
    ids=lambda row: f"{row['vehicle']} {row['fit']} {row.get('seed', 0)}",
)
def test_the_reference_table_at_full_size(full, row):
    training = full(row["vehicle"], row.get("peak"), row.get("steps", 150))
    test = full(row["vehicle"], row.get("peak"), seed=row.get("seed", 0))
    settings = dict(row["fit"])
    if settings.get("cut") is None and settings.get("boundary", "thin-plate") == "thin-plate":
        settings["cut"] = 1e-14
    figures = evaluate(eigen_fit(training, **settings), test, slice(None), 0, relift=False).figures()
    mean, std, median = row["rmse"]
    tolerance = row.get("a", 0) + row.get("r", 0) * mean + 0.05  # half the last digit of most
    assert figures["rmse"]["mean"] == pytest.approx(mean, abs=max(tolerance, 0.5 if mean == int(mean) else 0))
    if std is not None:
        assert figures["rmse"]["std"] == pytest.approx(std, abs=max(0.02 * std, 0.6, tolerance))
    if median is not None:
        assert figures["rmse"]["median"] == pytest.approx(median, abs=max(tolerance, 0.5))


def test_the_figure_the_paper_prints(full):
    """23 ± 15 %: thin-plate splines, raw, as the text says; and the share of the worst states where data are few."""
    predictor = eigen_fit(full("ctu-2020"), **{"cut": 1e-14})
    assert predictor.functions == 4410
    assert predictor.dynamics.modes.rates.real[1:4] == pytest.approx(REFERENCE["rates"]["ctu-2020"], abs=5e-4)
    figures = evaluate(predictor, full("ctu-2020", seed=0), slice(None), 0, relift=False).figures()
    assert figures["rmse"]["mean"] == pytest.approx(22.95, abs=0.1)
    assert figures["rmse"]["std"] == pytest.approx(13.73, abs=0.1)
    assert figures["outside"] == 41


@pytest.mark.parametrize("vehicle", ["ctu-2020", pytest.param("rimac-2018", marks=pytest.mark.slow)])
def test_where_the_errors_are(full, vehicle):
    predictor = eigen_fit(full(vehicle), **{"boundary": "optimal", "cut": 1e-10})
    found = dmd_rates(full(vehicle).x, 0.01)
    assert np.sort(found.real) == pytest.approx(np.sort(REFERENCE["rates"][vehicle]), abs=1e-3)
    figures = evaluate(predictor, full(vehicle, seed=0), slice(None), 0, relift=False).figures()
    assert figures["worst_in_emptiest"] == pytest.approx(REFERENCE["worst_in_emptiest"][vehicle], abs=0.035)
    if vehicle == "ctu-2020":
        assert figures["start_error"]["mean"] == pytest.approx(REFERENCE["start_error"], rel=0.02)


@pytest.mark.parametrize("rank", REFERENCE["ranks"])
def test_the_cut_decides_the_figure(full, rank):
    """The singular values of the normalised exponentials, one direction more at a time."""
    training = full("ctu-2020")
    V = exponentials(lattice(dmd_rates(training.x, 0.01), 2), 0.01 * np.arange(151.0))
    singular = np.linalg.svd(V / np.linalg.norm(V, axis=0), compute_uv=False)
    kept = int(rank)
    cut = 0.9 * singular[kept - 1] / singular[0]
    predictor = eigen_fit(training, **{"boundary": "optimal", "cut": cut})
    assert predictor.regression.rank == kept
    figures = evaluate(predictor, full("ctu-2020", seed=0), slice(None), 0, relift=False).figures()
    assert figures["rmse"]["mean"] == pytest.approx(REFERENCE["ranks"][rank], rel=0.01)


@pytest.mark.parametrize(
    "vehicle",
    [one if one == "ctu-2020" else pytest.param(one, marks=pytest.mark.slow) for one in REFERENCE["baselines"]],
)
def test_the_baselines(full, vehicle):
    training, test = full(vehicle), full(vehicle, seed=0)
    expected = REFERENCE["baselines"][vehicle]
    parameters = read_vehicle(locate("vehicles", vehicle, "vehicle"))
    from dataclasses import asdict

    about = {"plant": "slips", "v_eps": 0.1, "vehicle": asdict(parameters)}
    coverage = edmd.coverage(training)
    for kind in FORECASTS:
        one = Forecast(kind, 0.01, coverage, training.state_channels, training.input_channels, about)
        found = evaluate(one, test, slice(None), 0, relift=False).figures()["rmse"]["mean"]
        assert found == pytest.approx(expected[kind], abs=0.6)
    dmd = edmd.fit(training, edmd.FitEdmd.of(basis="states").basis_from(training))
    assert evaluate(dmd, test, slice(None), 0, relift=False).figures()["rmse"]["mean"] == pytest.approx(
        expected["dmd"], abs=0.6
    )


@pytest.mark.parametrize(
    "settings",
    [{"cut": 1e-14}, {"boundary": "optimal"}, {"boundary": "optimal", "cut": 1e-10}],
    ids=["thin-plate", "optimal", "optimal, cut"],
)
def test_started_at_a_tabulated_sample_it_is_the_directly_evaluated_fit(full, settings):
    """C A^k from sample k0 against e^{λ (k0 + k) dt} g summed in forty digits, to 1e-9 of the largest state.

    In plain exponentials the terms of that sum are 1e10 times larger than it, and doubles are left with six digits.
    """
    training = full("ctu-2020")
    predictor = eigen_fit(training, **{**settings})
    modes, copies = predictor.dynamics.modes, predictor.dynamics.modes.copies
    L, k0, rows = len(modes.rates), 60, np.arange(0, 441, 63)
    found = predictor.predict(np.asarray(training.x[rows, k0]), steps=50)
    (found_nodes, _), nodes = (
        predictor.observables.nodes.find(np.asarray(training.x[rows, k0])),
        predictor.observables.nodes,
    )
    looked_up, at = nodes.trajectory[found_nodes[:, 0]], nodes.sample[found_nodes[:, 0]]
    assert (at == k0).all()
    with mp.workdps(40):
        rates = [mp.mpf(float(rate)) for rate in modes.rates.real]
        assert not modes.rates.imag.any()
        couplings = [mp.mpf(float(c)) for c in modes.couplings]

        def exponential(i, j, t):
            """Entry (i, j) of the block of e^{Kt}: couplings times the divided difference of e^{λt}, term by term."""
            chosen = rates[j : i + 1]
            terms = [
                mp.exp(a * t) / mp.fprod(a - b for m, b in enumerate(chosen) if m != n) for n, a in enumerate(chosen)
            ]
            return mp.fprod(couplings[j:i]) * mp.fsum(terms)

        C = predictor.C.reshape(3, copies, L)
        for trajectory, j in enumerate(looked_up):
            start = predictor.observables.starts[j]
            if start.shape[1] == 1:
                h = [[mp.fdot(C[s, :, i].tolist(), start[:, 0].tolist()) for i in range(L)] for s in range(3)]
            for k in (0, 17, 50):
                t = mp.mpf(float(k0 + k)) * mp.mpf(0.01)
                for s in range(3):
                    if start.shape[1] == 1:
                        direct = mp.fsum(h[s][i] * exponential(i, 0, t) for i in range(L))
                    else:
                        direct = mp.fsum(exponential(L - 1, i, t) * mp.mpf(float(start[s, i])) for i in range(L))
                    assert abs(found[trajectory, k, s] - float(direct)) < 1e-9 * 30
