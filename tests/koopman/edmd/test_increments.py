from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from koopcli.errors import InvalidValueError
from koopcli.koopman import stored
from koopcli.koopman.bases.polynomial import Tensor, Total
from koopcli.koopman.bases.states import StatesAlone
from koopcli.koopman.edmd import increments
from koopcli.koopman.edmd.fit import MEASURED, FitEdmd, fit, fit_measured
from koopcli.koopman.edmd.increments import fit_increments
from koopcli.records import Channels, Episodes, Trajectories
from tests.koopman.edmd.delayed import Delayed, channels, episodes_of

LINEAR = Total(1)


@pytest.fixture(scope="module")
def system():
    return Delayed()


@pytest.fixture(scope="module")
def data(system):
    return system.episodes()


def rolled(system, history, x0, u):
    """x_0 .. x_steps by the system itself, from a history that is newest first."""
    xs = [*np.moveaxis(history[0][:, ::-1], 1, 0), x0]
    us = [*np.moveaxis(history[1][:, ::-1], 1, 0)]
    for k in range(u.shape[1]):
        us.append(u[:, k])
        xs.append(system.next(xs, us))
    return np.stack(xs[history[0].shape[1] :], axis=1)


def starts(system, n=20, steps=15, seed=8):
    rng = np.random.default_rng(seed)
    x0, u = rng.uniform(-2, 2, (n, system.n_x)), rng.uniform(-0.9, 0.9, (n, steps, system.n_u))
    p = system.delays
    return x0, u, (rng.uniform(-2, 2, (n, p, system.n_x)), rng.uniform(-0.9, 0.9, (n, p, system.n_u)))


def test_delays_of_two_steps_and_products_are_recovered(system, data):
    """From five episodes, the last of which has one pair, to 1e-8, over fifteen steps."""
    predictor = fit_increments(data, LINEAR, 2, True, ridge=0.0)
    A, B, N, p, n = predictor.dynamics.A, predictor.dynamics.B, predictor.dynamics.N, 2, 2
    x = slice(1, 1 + n)
    assert A[x, 0] == pytest.approx(system.c, abs=1e-8)
    for j in range(p + 1):
        assert A[x, 1 + n * j : 1 + n * (j + 1)] == pytest.approx(system.F[j], abs=1e-8)
    assert B[x] == pytest.approx(system.G[0], abs=1e-8)
    behind = 1 + n * (p + 1)
    for j in range(p):
        assert A[x, behind + n * j : behind + n * (j + 1)] == pytest.approx(system.G[j + 1], abs=1e-8)
    assert N[:, x, x] == pytest.approx(system.H, abs=1e-8)
    elsewhere = np.ones_like(N)
    elsewhere[:, x, x] = 0.0
    assert not (N * elsewhere).any()  # of the present states alone
    x0, u, history = starts(system)
    assert predictor.predict(x0, u, history=history) == pytest.approx(rolled(system, history, x0, u), abs=1e-8)


def test_a_pair_across_a_seam_would_show(system, data):
    """The same rows as one episode: nothing is recovered."""
    joined = episodes_of([data.x], [data.u])
    predictor = fit_increments(joined, LINEAR, 2, True, ridge=0.0)
    assert np.abs(predictor.dynamics.A[1:3, 1:3] - system.F[0]).max() > 1e-2


def test_the_lifted_prediction_is_the_recursion_in_states_and_inputs(system, data):
    """With the coefficients of a fit with a ridge, of a basis of degree 2 with factors that are orthonormal."""
    for basis, products in ((LINEAR, True), (LINEAR, False), (Total(2), True)):
        predictor = fit_increments(data, basis, 2, products, ridge=1e-2)
        x0, u, (past_x, past_u) = starts(system, steps=8)
        psi, p, C = predictor.observables.present, 2, predictor.observables.present.state_map
        A, B = predictor.dynamics.A, predictor.dynamics.B
        N = predictor.dynamics.N if products else np.zeros((2, *A.shape))
        f = psi.functions
        w, xs, us = psi.lift(x0), [*past_x[:, ::-1].swapaxes(0, 1)], [*past_u[:, ::-1].swapaxes(0, 1)]
        seen = [x0]
        for k in range(u.shape[1]):
            past = np.hstack([*(xs[-1 - j] for j in range(p)), *(us[-1 - j] for j in range(p))])
            xs.append(w @ C.T)
            us.append(u[:, k])
            mixed = np.einsum("ni,ifg,ng->nf", u[:, k], N[:, :f, :f], w)
            w = w @ A[:f, :f].T + past @ A[:f, f:].T + u[:, k] @ B[:f].T + mixed
            seen.append(w @ C.T)
        found = predictor.predict(x0, u, history=(past_x, past_u))
        assert found == pytest.approx(np.stack(seen, axis=1), rel=1e-10, abs=1e-10)


def test_long_predictions_are_rolled_alike(system, data):
    """Past the steps where a linear response is cut into stretches, whose starts are lifted states."""
    predictor = fit_increments(data, LINEAR, 2, False)
    x0, u, history = starts(system, n=3, steps=300)
    z = predictor.lift(predictor.observables.augmented(x0, *history))
    seen = [x0]
    for k in range(300):
        z = z @ predictor.dynamics.A.T + u[:, k] @ predictor.dynamics.B.T
        seen.append(z @ predictor.C.T)
    assert predictor.predict(x0, u, history=history) == pytest.approx(np.stack(seen, axis=1), rel=1e-9, abs=1e-9)


def test_the_sums_are_those_of_the_definition(data):
    """(VᵀV/rows + ridge I) W = VᵀY/rows with the constant and the centred, scaled columns, written out."""
    ridge, predictor = 0.03, fit_increments(data, LINEAR, 1, True, ridge=0.03)
    rows = [(k, a) for a, b in zip(data.bounds, data.bounds[1:], strict=False) for k in range(a + 1, b - 1)]
    k = np.array([row for row, _ in rows])
    x, u = data.x, data.u
    products = (u[k][:, :, np.newaxis] * x[k][:, np.newaxis]).reshape(len(k), -1)
    columns = np.hstack([x[k], x[k - 1], u[k - 1], u[k], products])
    V = np.hstack([np.ones((len(k), 1)), (columns - columns.mean(axis=0)) / columns.std(axis=0)])
    Y = x[k + 1] - x[k]
    W = np.linalg.solve(V.T @ V / len(k) + ridge * np.eye(V.shape[1]), V.T @ Y / len(k))
    increment = V @ W
    z = predictor.lift(np.hstack([x[k], x[k - 1], u[k - 1]]))
    x_next = predictor.dynamics.advance(z, u[k]) @ predictor.C.T
    assert x_next - x[k] == pytest.approx(increment, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("basis", [LINEAR, Total(2)], ids=["linear", "degree 2"])
def test_a_large_ridge_holds_the_state(system, data, basis):
    predictor = fit_increments(data, basis, 2, True, ridge=1e300)
    x0, u, history = starts(system)
    held = np.repeat(x0[:, np.newaxis], u.shape[1] + 1, axis=1)
    assert predictor.predict(x0, u, history=history) == pytest.approx(held, rel=1e-13, abs=1e-13)


def test_without_past_and_products_it_is_dmd_with_control(data):
    predictor = fit_increments(data, LINEAR, 0, False, ridge=0.0)
    inside = np.setdiff1d(np.arange(data.rows), data.bounds[1:] - 1)
    V = np.hstack([np.ones((len(inside), 1)), data.x[inside], data.u[inside]])
    W = np.linalg.lstsq(V, data.x[inside + 1], rcond=None)[0]
    assert predictor.dynamics.A[1:] == pytest.approx(W[:3].T, rel=1e-10, abs=1e-10)
    assert predictor.dynamics.B[1:] == pytest.approx(W[3:].T, rel=1e-10, abs=1e-10)
    assert not predictor.needs_history


@pytest.mark.parametrize("rows", [1, 7, 50])
def test_the_size_of_blocks_does_not_matter(data, rows, monkeypatch):
    whole = fit_increments(data, LINEAR, 2, True)
    monkeypatch.setattr(increments, "ROWS", (rows, rows))
    again = fit_increments(data, LINEAR, 2, True)
    for name in ("A", "B", "N"):
        expected = getattr(whole.dynamics, name)
        assert getattr(again.dynamics, name) == pytest.approx(expected, rel=1e-12, abs=1e-12)


def test_units_and_signs_change_nothing(system, data):
    """States and inputs times factors of either sign: the same predictions in those units, with a ridge."""
    fx, fu = np.array([-57.3, 1e-3]), np.array([3.6, -1e4])
    other = replace(data, x=data.x * fx, u=data.u * fu)
    x0, u, history = starts(system)
    for basis in (LINEAR, Total(2)):
        a = fit_increments(data, basis, 2, True).predict(x0, u, history=history)
        b = fit_increments(other, basis, 2, True).predict(x0 * fx, u * fu, history=(history[0] * fx, history[1] * fu))
        assert b / fx == pytest.approx(a, rel=1e-9, abs=1e-9)


def test_it_survives_storage(system, data):
    for basis, products in ((LINEAR, True), (LINEAR, False), (Total(2), True)):
        predictor = fit_increments(data, basis, 2, products)
        packed = predictor.pack()
        again = stored.predictor(packed)
        assert again == predictor
        assert again.pack().meta == packed.meta
        x0, u, history = starts(system)
        assert (again.predict(x0, u, history=history) == predictor.predict(x0, u, history=history)).all()
        assert packed.arrays["limits"].axes == ("lower_and_upper", "input")
        assert packed.meta["lift"]["memory"] == 2


def test_limits_are_those_of_the_pairs(data):
    """The last input of an episode acts beyond it, and is in none."""
    inside = np.setdiff1d(np.arange(data.rows), data.bounds[1:] - 1)
    limits = fit_increments(data, LINEAR, 2, True).limits
    assert (limits == [data.u[inside].min(axis=0), data.u[inside].max(axis=0)]).all()


def test_an_input_that_never_moves_is_noted_and_has_no_part(system, data):
    still = replace(data, u=np.column_stack([data.u[:, 0], np.full(data.rows, 0.1)]))
    predictor = fit_increments(still, LINEAR, 2, True, ridge=0.0)
    assert predictor.regression.notes == ("u1 is 0.1 rad throughout: the fit knows nothing of it",)
    assert not predictor.dynamics.B[1:3, 1].any()
    assert np.abs(predictor.dynamics.A).max() < 1e3  # its products with states are those states again
    assert stored.predictor(predictor.pack()).regression == predictor.regression


def test_a_quantised_state_lowers_the_degree_and_is_noted():
    rng = np.random.default_rng(2)
    x = np.column_stack([rng.uniform(-1, 1, 200), rng.integers(0, 2, 200)])
    data = episodes_of([x], [rng.uniform(-1, 1, (200, 1))])
    for basis, functions in ((Total(3), 3), (Tensor(3), 4)):
        predictor = fit_increments(data, basis, 0, False)
        assert predictor.functions == functions
        assert predictor.regression.notes == (
            "x1 has 2 different values, too few for degree 3: fitted with degree 1 at most",
        )
    still = fit_increments(replace(data, x=np.column_stack([x[:, 0], np.full(200, 3.3)])), Total(2), 2, True)
    assert still.regression.notes == ("x1 has 1 different value, too few for degree 2: fitted with degree 1 at most",)
    assert still.predict(np.array([0.1, 3.3]), np.zeros((50, 1)))[:, 1] == pytest.approx(np.full(51, 3.3), rel=1e-12)
    assert fit_increments(data, LINEAR, 0, False).regression.notes == ()


def test_what_cannot_be_fitted_is_refused(data):
    with pytest.raises(InvalidValueError, match="needs a basis with a constant"):
        fit_increments(data, StatesAlone(), 0, False)
    with pytest.raises(InvalidValueError, match="not finite"):
        fit_increments(replace(data, x=np.where(data.x == data.x[5], np.nan, data.x)), LINEAR, 0, False)
    few = replace(data, x=data.x[:9], u=data.u[:9], bounds=np.array([0, 9]), starts=data.starts[:1], runs=data.runs[:1])
    with pytest.raises(InvalidValueError, match=r"6 rows with 0\.2 s before them cannot determine 17 unknowns"):
        fit_increments(few, LINEAR, 2, True)


def test_settings_choose_memory_and_terms(system, data):
    """0.2 s unless another memory is asked for; 0.1 s are one step here."""
    default = fit_measured(data)
    assert default.memory == 2
    assert default == fit_increments(data, LINEAR, 2, False)
    assert fit_measured(data, MEASURED.but(memory=0.1, terms="products")) == fit_increments(data, LINEAR, 1, True)
    assert not fit_measured(data, MEASURED.but(memory=0.0)).needs_history
    held = fit_measured(data, MEASURED.but(increment_ridge=1e6))
    x0, u, _ = starts(system)
    assert held.predict(x0, u)[:, -1] == pytest.approx(x0, abs=1e-3)


@pytest.mark.parametrize(("dt", "steps"), [(0.04, 5), (0.05, 4), (0.03, 7), (0.5, 1)])
def test_the_usual_memory_is_rounded_to_steps(data, dt, steps):
    assert fit_measured(replace(data, dt=dt), MEASURED).memory == steps


def test_settings_that_do_not_fit_measured_data_are_refused(data):
    refused = {
        r"'fit-edmd.memory' 0\.25 s is no whole number of steps of 0\.1 s: choose 0\.2 or 0\.3": {"memory": 0.25},
        r"a memory of 14 s is longer than every episode \(the longest has 13\.9 s\)": {"memory": 14.0},
        "the terms 'bilinear' multiply inputs with past states": {"terms": "bilinear"},
        "the terms 'generator' multiply": {"terms": "generator"},
        "'fit-edmd.ridge' 0.001 draws a fit towards zero": {"ridge": 1e-3},
        "the solver 'cholesky-monomials' is for simulated": {"solver": "cholesky-monomials"},
    }
    for message, values in refused.items():
        with pytest.raises(InvalidValueError, match=message):
            fit_measured(data, MEASURED.but(**values))


def test_simulated_data_have_a_memory_where_it_is_asked_for(system):
    """Trajectories of the delayed system, recovered by the same settings."""
    rng = np.random.default_rng(5)
    u, xs = rng.uniform(-1, 1, (30, 12, 2)), [rng.uniform(-5, 5, (30, 2)) for _ in range(3)]
    while len(xs) < 13:
        xs.append(system.next(xs, [u[:, k] for k in range(len(xs))]))
    data = Trajectories(np.stack(xs, axis=1), u, 0.1, channels("x", 2), channels("u", 2), plant={"plant": "delayed"})
    how = FitEdmd.of(basis="total", order=1, memory=0.2, terms="products", increment_ridge=0.0)
    predictor = fit(data, how.basis_from(data), how)
    x0, u, history = starts(system)
    assert predictor.predict(x0, u, history=history) == pytest.approx(rolled(system, history, x0, u), abs=1e-8)
    assert predictor.plant == {"plant": "delayed"}
    without = FitEdmd.of(basis="total", order=1)
    assert fit(data, without.basis_from(data), without).memory == 0
    assert fit(data, without.basis_from(data), without).limits is None


def test_past_states_as_smooth_as_measured_ones_keep_a_tame_fit():
    """46 lifted states of which most directions are nearly empty: the ridge leaves a fit that does not grow."""
    t = np.arange(4000) * 0.02
    rng = np.random.default_rng(0)
    u = np.column_stack([np.sin(0.7 * t), np.cos(1.3 * t + 1)])
    x = np.column_stack([20 + np.sin(0.7 * t - 0.5), 0.2 * np.cos(1.3 * t), np.sin(2 * t)])
    x += 1e-3 * rng.standard_normal(x.shape)
    data = Episodes(
        x, u, 0.02, np.array([0, 4000]), np.zeros(1), np.zeros(1, dtype=np.int64),
        Channels(("v", "r", "s"), ("m/s", "rad/s", "1")), channels("u", 2),
    )  # fmt: skip
    predictor = fit_measured(data, MEASURED.but(terms="products"))
    assert predictor.functions == 1 + 3 + 10 * 5
    assert predictor.spectral_radius < 1.05


def test_data_without_inputs_are_fitted_too():
    x = np.random.default_rng(0).standard_normal((60, 2))
    data = episodes_of([x], [np.zeros((60, 0))])
    for terms in ("linear", "products"):
        predictor = fit_measured(data, MEASURED.but(terms=terms))
        assert predictor.predict(x[0], np.zeros((3, 0))).shape == (4, 2)
        assert predictor.limited_share(np.zeros((3, 0))) == 0.0
