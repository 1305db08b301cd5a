"""Axle forces as inputs of eigenfunctions: exact in the equations of motion, and without a fit in the predictor."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from koopcli.choices import essential
from koopcli.errors import InvalidValueError
from koopcli.koopman import stored
from koopcli.koopman.eigen.fit import FitEigen
from koopcli.koopman.eigen.forces import CHANGES, force_matrix, with_forces
from koopcli.koopman.predictor.dynamics import force_driven
from koopcli.koopman.predictor.dynamics.diagonal import Diagonal
from koopcli.koopman.predictor.dynamics.force_driven import INPUT_MATRICES, ForceDriven
from koopcli.koopman.scores.metrics import rmse
from koopcli.records import OF_STATES, Channels, Trajectories
from koopcli.simulation import sampling
from koopcli.vehicles import tyre
from koopcli.vehicles.axles import Axles
from koopcli.vehicles.plants.slips import SlipInput
from tests.conftest import ball_of, eigen_fit, trajectories_of

AHEAD = {"window": "horizon", "kind": "comb", "pairs": 10, "cut": 1e-10, "lift": "polyharmonic"}
WITHOUT_RELIFT = tuple(where for where in INPUT_MATRICES if where != "relift")


@pytest.fixture(scope="module")
def coasting(sliding):
    """A predictor of a coasting car, of modest accuracy."""
    data = trajectories_of(sliding, ball_of(sliding, 600, 3), 80)
    about = {"plant": "slips", "vehicle": vars(sliding.parameters)}
    return eigen_fit(
        replace(data, plant=about), **AHEAD, frame="world", tabulated=50, nodes=40, spacing=3, power=0.5, trust=True
    )


@pytest.fixture(scope="module")
def pushed(sliding, vehicle):
    """First states (40, 3), changes of the forces (40, 30, 4) held for five samples, and what follows by the equations
    of motion.
    """
    x0 = 0.8 * np.asarray(ball_of(sliding, 40, 8).x0)
    largest = np.repeat(2 * Axles(vehicle, 0.1, "none").grip, 2)
    u = np.repeat(0.4 * largest * np.random.default_rng(3).uniform(-1, 1, (40, 6, 4)), 5, axis=1)
    return x0, u, followed(sliding, x0, u)


def followed(plant, x, u, substeps=8):
    """Runge and Kutta's steps of ẋ = f(x) + G ΔF."""
    G, h = force_matrix(plant.parameters), 0.01 / substeps
    out = [x]
    for k in range(u.shape[1]):

        def rate(x, pushed=u[:, k] @ G.T):
            return plant.rhs(x, np.zeros((len(x), 4))) + pushed

        for _ in range(substeps):
            a = rate(x)
            b = rate(x + h / 2 * a)
            c = rate(x + h / 2 * b)
            x = x + h / 6 * (a + 2 * b + 2 * c + rate(x + h * c))
        out.append(x)
    return np.stack(out, axis=1)


# --- the equations of motion


@pytest.mark.parametrize("combined", ["none", "ellipse"])
def test_what_the_tyres_change_acts_through_a_constant_matrix(vehicle, combined):
    """ẋ = f(x, 0) + G (F(x, u) - F(x, 0)) for any slips and steer, to rounding."""
    g, axles = np.random.default_rng(0), Axles(vehicle, 0.1, combined)
    x, u = g.uniform(-1, 1, (50, 3)) * [30, 10, 3], g.uniform(-1, 1, (50, 4)) * [0.6, 0.15, 0.6, 0.15]
    plant = SlipInput(vehicle, 0.1, combined)

    def forces(u):
        steer = u[:, 0::2]
        along, across = axles.velocities(x, steer)
        F = axles.turned(*axles.forces(tyre.slip_angle(along, across, 0.1), u[:, 1::2]), steer)
        return np.stack(F, axis=-1).reshape(50, 4)

    changed = plant.rhs(x, u) - plant.rhs(x, 0 * u)
    assert changed == pytest.approx((forces(u) - forces(0 * u)) @ force_matrix(vehicle).T, rel=1e-9, abs=1e-9)


# --- the predictor


@pytest.mark.parametrize("where", INPUT_MATRICES)
def test_a_linear_system_is_driven_as_its_matrix_says(where):
    """Its lift is linear in the state, so B is the same wherever it is taken; half a step before and half after is of
    order two in the step.
    """
    F = np.array([[-1.0, 4.0, 0.3], [-4.0, -1.0, 0.0], [0.0, 0.5, -2.0]])
    G = np.array([[1.0, 0.0], [0.0, 2.0], [0.5, 0.5]])
    errors = []
    for dt in (0.01, 0.005):
        step, samples = expm(F * dt).T, round(0.8 / dt)
        x = np.empty((120, samples + 1, 3))
        x[:, 0] = sampling.ball(0, 120)
        for k in range(samples):
            x[:, k + 1] = x[:, k] @ step
        data = Trajectories(
            x, np.zeros((120, samples, 1)), dt, Channels(("a", "b", "c"), ("1",) * 3), Channels(("u",), ("1",))
        )
        fit = eigen_fit(data, **{**AHEAD, "cut": 1e-12}, tabulated=round(0.4 / dt), nodes=8)
        driven = replace(
            fit, dynamics=ForceDriven(fit.dynamics.modes, 2, G, where), input_channels=Channels(("p", "q"), ("N", "N"))
        )
        u = np.repeat([[[1.0, -0.5], [-0.3, 0.8], [0.6, 0.1]]], round(0.1 / dt), axis=1)  # (1, steps, 2)
        moved = expm(dt * np.block([[F, G], [np.zeros((2, 5))]]))
        true = [np.array([0.1, 0.2, -0.1])]
        for k in range(u.shape[1]):
            true.append(moved[:3, :3] @ true[-1] + moved[:3, 3:] @ u[0, k])
        errors.append(np.abs(driven.predict(true[0], u[0]) - true).max())
    assert errors[1] < 1e-3
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.2)


def test_errors_fall_with_how_often_the_input_matrix_is_taken(coasting, vehicle, pushed):
    """Without it the error is that of a coasting car; between two states predicted it is near that without forces."""
    coasts = followed(SlipInput(vehicle), pushed[0], 0 * pushed[1])
    x0, u, true = pushed
    error = {where: rmse(with_forces(coasting, vehicle, where).predict(x0, u), true).mean() for where in INPUT_MATRICES}
    none = rmse(coasting.predict(x0, steps=30), true).mean()
    least = rmse(coasting.predict(x0, steps=30), coasts).mean()
    assert error["first"] < 0.5 * none
    assert error["every"] < 0.6 * error["first"]
    assert error["between"] < 0.9 * error["every"]
    assert error["between"] < 1.2 * least < 1.0
    assert error["relift"] < 1.2 * least


@pytest.mark.parametrize("where", WITHOUT_RELIFT)
def test_without_forces_it_is_the_coasting_predictor(coasting, vehicle, pushed, where):
    """To the last bit."""
    x0 = pushed[0]
    driven = with_forces(coasting, vehicle, where)
    assert (driven.predict(x0, steps=30) == coasting.predict(x0, steps=30)).all()
    still = driven.predict(x0, np.full((40, 30, 4), 1e-9))
    assert still == pytest.approx(coasting.predict(x0, steps=30), abs=1e-6)


def test_one_stretch_over_all_samples_is_the_first_input_matrix(coasting, vehicle, pushed):
    x0, u, _ = pushed
    first = with_forces(coasting, vehicle, "first").predict(x0, u)
    assert (with_forces(coasting, vehicle, "every", 30).predict(x0, u) == first).all()
    whole, cut = (with_forces(coasting, vehicle, "between", every).predict(x0, u) for every in (30, 31))
    assert (whole == cut).all()  # a stretch ends where the samples do


def test_a_prediction_depends_on_no_later_input(coasting, vehicle, pushed):
    """From one stretch to the next; within one, ``between`` knows how it ends."""
    x0, u, _ = pushed
    later = u.copy()
    later[:, 10:] *= -1
    for where in INPUT_MATRICES:
        driven = with_forces(coasting, vehicle, where)
        assert (driven.predict(x0, u)[:, :11] == driven.predict(x0, later)[:, :11]).all()


def test_many_trajectories_are_predicted_one_part_after_the_other(coasting, vehicle, pushed, monkeypatch):
    x0, u, _ = pushed
    driven, told = with_forces(coasting, vehicle, "between"), []
    whole = driven.predict(x0, u)
    monkeypatch.setattr(force_driven, "TOGETHER", 7)
    parts = driven.predict(x0, u, progress=lambda done, total: told.append((done, total)))
    assert parts == pytest.approx(whole, abs=1e-6)
    assert told == sorted(told)
    assert told[-1] == (1200, 1200)


def test_a_step_is_a_prediction_of_one(coasting, vehicle, pushed):
    x0, u, _ = pushed
    for where in WITHOUT_RELIFT[:2]:
        driven = with_forces(coasting, vehicle, where)
        assert driven.step(x0, u[:, 0]) == pytest.approx(driven.predict(x0, u[:, :1])[:, 1], abs=1e-9)
    relifted = with_forces(coasting, vehicle, "relift")
    twice = relifted.step(relifted.step(x0, u[:, 0]), u[:, 1])
    assert twice == pytest.approx(relifted.predict(x0, u[:, :2])[:, 2], abs=1e-9)


def test_it_says_what_moves_it(coasting, vehicle):
    driven = with_forces(coasting, vehicle)
    assert driven.knows_inputs
    assert driven.dynamics.acting.tolist() == [True] * 4
    assert driven.input_channels == CHANGES
    assert "driven by forces" in repr(driven)
    assert (driven.horizon, with_forces(coasting, vehicle, "relift").horizon) == (coasting.horizon, None)
    assert coasting.trust is not None  # an estimate for a car that coasts ...
    assert driven.bound(np.ones((1, 3))) is None  # ... says nothing of one that is driven
    assert driven.spectral_radius == coasting.spectral_radius
    x = np.array([[20.0, 1.0, 0.5]])
    found = driven.dynamics.input_matrices(driven.observables, x)
    assert found == pytest.approx(driven.observables.derivative(x) @ force_matrix(vehicle), rel=1e-12)


# --- storage


@pytest.mark.parametrize("where", INPUT_MATRICES)
def test_it_survives_storage(coasting, vehicle, pushed, where):
    x0, u, _ = pushed
    driven = with_forces(coasting, vehicle, where, every=3)
    packed = driven.pack()
    again = stored.predictor(packed)
    assert again.pack() == packed
    assert (again.predict(x0[:5], u[:5]) == driven.predict(x0[:5], u[:5])).all()
    assert packed.arrays["G"].units.count(",") == 3
    assert all(array.units != OF_STATES for array in packed.arrays.values())
    assert ("every" in packed.meta["dynamics"]) == (where in ("every", "between"))


def test_what_is_stored_of_a_coasting_predictor_has_none_of_it(coasting):
    packed = coasting.pack()
    assert "G" not in packed.arrays
    assert packed.meta["dynamics"].keys() == {"kind", "copies", "dt", "inputs", "spectral_radius"}
    assert type(stored.predictor(packed).dynamics) is Diagonal


# --- settings


def test_settings_that_were_there_before_are_known_by_the_same_values():
    assert "inputs" not in essential(FitEigen())
    assert essential(FitEigen.of(inputs="forces")).items() >= {("inputs", "forces")}
    given = FitEigen.of(inputs="forces", input_matrix="between", every=4).inputs
    assert (given.kind, given.input_matrix, given.every) == ("forces", "between", 4)
    with pytest.raises(InvalidValueError, match="every"):
        FitEigen.of(inputs="forces", every=0)


def test_a_fit_with_forces_is_the_coasting_fit_driven(coasting, vehicle):
    inputs = FitEigen.of(inputs="forces", input_matrix="first").inputs
    assert inputs.drive(coasting, coasting.plant) == with_forces(coasting, vehicle, "first")
    assert FitEigen().inputs.drive(coasting, coasting.plant) is coasting
    assert (inputs.horizon(30), FitEigen.of(inputs="forces", input_matrix="relift").inputs.horizon(30)) == (30, None)
    with pytest.raises(InvalidValueError, match="do not tell it: fit with fit-eigen"):
        inputs.drive(coasting, {})


# --- what is refused


def test_other_predictors_are_refused(sliding, coasting, vehicle):
    data = trajectories_of(sliding, ball_of(sliding, 60, 3), 80)
    paper = eigen_fit(data, tabulated=40, centres=20)
    with pytest.raises(InvalidValueError, match="got Tabulated: fit with the experiment best-eigen or quick-eigen"):
        with_forces(paper, vehicle)
    nearest = eigen_fit(data, **{**AHEAD, "lift": "linear"}, tabulated=40)
    with pytest.raises(InvalidValueError, match="the lift 'linear' has no derivative"):
        with_forces(nearest, vehicle)
    others = replace(coasting, state_channels=Channels(("a", "b", "c"), ("1",) * 3))
    with pytest.raises(InvalidValueError, match="act on the states v_x, v_y, yaw_rate, got a, b, c"):
        with_forces(others, vehicle)


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"input_matrix": "last"}, "'input_matrix' must be one of first, every, between, relift, got 'last'"),
        ({"every": 0}, "'every' must be a whole number of samples from 1 on, got 0"),
        ({"every": 2.5}, "from 1 on, got 2.5"),
    ],
)
def test_other_ways_are_refused(coasting, vehicle, given, says):
    with pytest.raises(InvalidValueError, match=says):
        with_forces(coasting, vehicle, **given)


def test_a_fit_is_refused_before_it_is_begun(sliding):
    forces = FitEigen.of(inputs="forces").inputs
    ahead = FitEigen.of(window="horizon", lift="polyharmonic")
    forces.check(True, ahead.lift, sliding.states)
    with pytest.raises(InvalidValueError, match="fitted to the horizon ahead: set fit-eigen"):
        forces.check(False, ahead.lift, sliding.states)
    with pytest.raises(InvalidValueError, match="the lift 'nearest' has no derivative"):
        forces.check(True, FitEigen().lift, sliding.states)
    with pytest.raises(InvalidValueError, match="of the plant 'slips'"):
        forces.check(True, ahead.lift, Channels(("v_x", "v_y", "yaw_rate", "wheel_rate_f"), ("1",) * 4))


def test_the_derivative_is_asked_for_of_a_lift_that_has_one(coasting, vehicle):
    driven = with_forces(coasting, vehicle)

    class Plain:
        functions = driven.functions

        def lift(self, x):
            return np.zeros((len(x), driven.functions))

    with pytest.raises(InvalidValueError, match="'Plain' has none"):
        force_driven.differentiable(Plain())
