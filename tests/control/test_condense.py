"""Predictions over the horizon and their derivatives by the plan."""

from dataclasses import replace

import numpy as np
import pytest

from koopcli.control.condense import EigenResponse, GeneratorResponse, RolledResponse, eigen_rows, toeplitz
from koopcli.control.controllers.controller import RECOVERY
from koopcli.control.lifted import future_of
from koopcli.control.limits import SCALE, Limits
from koopcli.control.linearised import Linearised
from koopcli.control.planner import Costs
from koopcli.control.tyres import Tyres
from koopcli.errors import InvalidValueError
from koopcli.simulation.integrate import rk4_step
from koopcli.vehicles.plants.forces import ForceInput
from koopcli.vehicles.plants.slips import SlipInput
from tests.control.conftest import solver

N, H = 6, 0.05
X = np.array([18.0, -6.0, 1.5])


def plan(seed=0, size=0.5):
    return np.random.default_rng(seed).uniform(-size, size, (N, 4))


def of_generator(fit, tyres):
    K = np.concatenate([fit.dynamics.K[:1], fit.dynamics.K[1:] * tyres.scale[:, np.newaxis, np.newaxis]])
    return GeneratorResponse(fit.observables.lift, K, fit.C, H)


def of_equations(p, tyres):
    body = ForceInput(p)

    def step(x, v):
        for _ in range(5):
            x = rk4_step(body.rhs, x, v * tyres.scale, H / 5)
        return x

    return RolledResponse(step)


def of_eigen(fit, tyres, coasting):
    seen = eigen_rows(fit.dynamics.modes.block, fit.C, fit.observables.projection, fit.dt, 5, N)
    return EigenResponse(future_of(fit.observables), seen, coasting, tyres.body_matrix * tyres.scale)


def remainders(response, x, v, direction):
    """What the first order leaves of a roll-out, for steps of 1, 1/2, 1/4 and 1/8 along a ``direction``."""
    states, S = response(x, v)
    sizes = 0.5 ** np.arange(4)
    return [
        np.abs(response(x, v + s * direction).states[1:].ravel() - states[1:].ravel() - s * S @ direction.ravel()).max()
        for s in sizes
    ]


@pytest.mark.parametrize("kind", ["generator", "equations"])
def test_what_the_first_order_leaves_has_the_order_two(kind, generator, rimac, tyres):
    """Halving a change of the plan quarters the remainder."""
    response = of_generator(generator, tyres) if kind == "generator" else of_equations(rimac, tyres)
    left = remainders(response, X, plan(), 0.2 * plan(1))
    orders = np.log2(np.array(left[:-1]) / left[1:])
    assert orders == pytest.approx(2, abs=0.1)


def test_the_sensitivity_of_the_generator_is_that_of_differences(generator, tyres):
    response = of_generator(generator, tyres)
    v, e = plan(), 1e-5
    S = response(X, v).sensitivity
    for i in range(4 * N):
        d = np.zeros(4 * N)
        d[i] = e
        d = d.reshape(N, 4)
        column = (response(X, v + d).states[1:] - response(X, v - d).states[1:]).ravel() / (2 * e)
        assert S[:, i] == pytest.approx(column, abs=1e-7)


def test_the_generator_says_what_the_equations_say(generator, rimac, tyres):
    """Within 1 cm/s and .01 rad/s after .3 s, and 2 % of the sensitivity."""
    one, other = of_generator(generator, tyres)(X, plan()), of_equations(rimac, tyres)(X, plan())
    assert one.states == pytest.approx(other.states, abs=0.02)
    assert np.abs(one.sensitivity - other.sensitivity).max() < 0.02 * np.abs(other.sensitivity).max()


def test_the_generator_steps_as_its_predictor(generator, tyres):
    """With inputs that stay for each prediction step, which is five of the predictor's samples."""
    v = plan()
    u = np.repeat(v * tyres.scale, 5, axis=0)
    x = generator.predict(X, u)[::5]
    assert of_generator(generator, tyres)(X, v).states == pytest.approx(x, abs=1e-6)


def test_a_later_input_changes_no_earlier_state(generator, tyres):
    S = of_generator(generator, tyres)(X, plan()).sensitivity.reshape(N, 3, N, 4)
    for k in range(N):
        assert (S[k, :, k + 1 :] == 0).all()


def test_toeplitz_is_the_answer_of_a_linear_system():
    g = np.random.default_rng(2)
    A, B, C = g.normal(size=(4, 4)) / 2, g.normal(size=(4, 2)), g.normal(size=(3, 4))
    blocks = np.array([C @ np.linalg.matrix_power(A, k) @ B for k in range(5)])
    u, z, out = g.normal(size=(5, 2)), np.zeros(4), []
    for k in range(5):
        z = A @ z + B @ u[k]
        out.append(C @ z)
    assert toeplitz(blocks) @ u.ravel() == pytest.approx(np.concatenate(out))


def test_rows_that_never_form_lifted_states_give_what_they_would(eigen, rimac, tyres):
    """z⁺ = A (z + dt/2 B ΔF) + dt/2 B ΔF, sample by sample with B frozen, against the rows of the condensed form."""
    coasting = Tyres(rimac, v_eps=0.1)
    v = plan()
    found = of_eigen(eigen, tyres, coasting)(X, v)
    z, slopes = eigen.observables.with_slopes(X[np.newaxis])
    z, B = z[0], slopes[0] @ (tyres.body_matrix * tyres.scale)
    states = [X]
    for k in range(N):
        change = v[k] - coasting.forces(states[-1], np.zeros(4))
        for _ in range(5):
            z = eigen.dynamics.modes @ (z + eigen.dt / 2 * B @ change) + eigen.dt / 2 * B @ change
        states.append(eigen.C @ z)
    assert found.states == pytest.approx(np.array(states), abs=1e-6)  # powers of A are far from normal


def test_eigenfunctions_answer_to_forces_linearly_but_for_the_coasting_ones(eigen, rimac, tyres):
    """Without coasting forces the sensitivity is exact, whatever the size of the change."""
    held = replace(rimac, mu_scale=1e-9)
    response = of_eigen(eigen, tyres, Tyres(held, v_eps=0.1))
    response = replace(response, coasting=_Nothing())
    assert max(remainders(response, X, plan(), plan(1))) < 1e-9


class _Nothing:
    arms = (0.0, 0.0)

    @staticmethod
    def of_axle(*_):
        return 0.0, 0.0


def test_eigenfunctions_predict_a_driven_car(eigen, rimac, tyres):
    """Forces that change by a tenth of the grip from those of coasting, .3 s: within 5 % of what they change."""
    plant, coasting = SlipInput(rimac), Tyres(rimac, v_eps=0.1)
    response = of_eigen(eigen, tyres, coasting)
    change = plan(3, 0.1)
    G = tyres.body_matrix * tyres.scale

    def rolled(extra):
        x, out = X[np.newaxis], [X]
        for k in range(N):
            for _ in range(20):
                x = rk4_step(lambda y, _, k=k: plant.rhs(y, np.zeros((1, 4))) + extra[k] @ G.T, x, x, H / 20)
            out.append(x[0])
        return np.array(out)

    still = np.zeros((N, 4))
    truth, free = rolled(change), rolled(still)
    v = np.array([coasting.forces(x, np.zeros(4)) for x in free[:-1]]) + change
    v0 = np.array([coasting.forces(x, np.zeros(4)) for x in free[:-1]])
    moved = response(X, v).states - response(X, v0).states
    assert np.abs(moved - (truth - free)).max() < 0.1 * np.abs(truth - free).max()


def test_a_lift_without_a_derivative_is_refused_before_the_first_step(eigen):
    class Stepped:
        def future_with_slopes(self, x):
            raise InvalidValueError("the lift 'nearest' has no derivative")

    with pytest.raises(InvalidValueError, match="no derivative"):
        future_of(Stepped())


@solver
@pytest.mark.parametrize("along", [False, True])
def test_slips_are_linearised_to_first_order(along, rimac, tyres):
    """Against the plant: exact where it was linearised, and what is left has the order two."""
    control = Linearised(tyres, Limits(), Costs(RECOVERY), 4, 0.025, along)
    plant, v = SlipInput(rimac, 1.0, "ellipse"), 0.2 * np.random.default_rng(5).uniform(-1, 1, (4, 4))
    if not along:
        v = np.broadcast_to(v[:1], (4, 4))
    states, S = control._rolled(X, v) if along else control._once(X, v[0])
    assert states[1] == pytest.approx(_on_slips(plant, X, v)[0], abs=1e-9)
    S = S[:3, :4]  # of the first step, which both know
    left = []
    for size in 0.1 * 0.5 ** np.arange(3):
        moved = v + size * np.eye(4)[0]
        left.append(np.abs(_on_slips(plant, X, moved)[0] - states[1] - size * S[:, 0]).max())
    assert np.log2(np.array(left[:-1]) / left[1:]) == pytest.approx(2, abs=0.3)


def _on_slips(plant, x, v):
    out = []
    for row in v:
        for _ in range(4):
            x = rk4_step(plant.rhs, x, row * SCALE, 0.025 / 4)
        out.append(x)
    return out
