"""Controllers by name: what each needs, and what a step gives."""

import sys
from dataclasses import replace

import numpy as np
import pytest

from koopcli.checks import restored
from koopcli.choices import essential, written
from koopcli.control import CONTROLLERS, Controller, ControllerChoice
from koopcli.control.controllers.controller import TRACKING
from koopcli.control.planner import Planner
from koopcli.errors import InvalidValueError, UsageError
from koopcli.koopman.bases.polynomial import Anisotropic
from koopcli.vehicles.plants.wheels import TorqueInput
from tests.control.conftest import solver

X, AHEAD = np.array([20.0, 0.0, 6.0]), np.array([15.0, 0.0, 0.0])


def fits(kind, request):
    return request.getfixturevalue(kind) if kind in ("eigen", "generator") else None


def test_the_registry():
    assert set(CONTROLLERS) == {"eigen", "generator", "equations", "ltv", "rti", "esc", "none"}
    assert {name for name, kind in CONTROLLERS.items() if not kind.solves} == {"esc", "none"}
    assert {name for name, kind in CONTROLLERS.items() if kind.dynamics} == {"eigen", "generator"}


@solver
@pytest.mark.parametrize("kind", sorted(CONTROLLERS))
def test_a_step_keeps_to_rates_and_bounds_and_can_be_repeated(kind, rimac, request):
    control = CONTROLLERS[kind]().of(rimac, fits(kind, request))
    rates, bounds = np.array([4.0, 3.0, 4.0, 3.0]), np.array([0.6, 0.15, 0.6, 0.15])

    def steps():
        control.reset()
        return np.array([control.step(X, AHEAD) for _ in range(8)])

    u = steps()
    assert control.facts.solved
    assert control.facts.kkt < 1e-6
    assert (np.abs(np.diff(u, axis=0, prepend=0.0)) <= 0.01 * rates + 1e-12).all()
    assert (np.abs(u) <= bounds + 1e-12).all()
    assert (steps() == u).all()


@solver
@pytest.mark.parametrize("kind", ["eigen", "generator", "equations", "ltv", "rti"])
def test_a_plan_starts_at_the_state_and_lasts_half_a_second(kind, rimac, request):
    control = CONTROLLERS[kind]().of(rimac, fits(kind, request))
    assert control.plan is None
    control.step(X, AHEAD)
    plan = control.plan
    assert (plan.states[0] == X).all()
    assert plan.times[0] == 0
    assert plan.times[-1] == pytest.approx(0.5)
    assert len(plan.inputs) == len(plan.states) - 1 == len(plan.times) - 1 == len(control.times)
    assert np.abs(plan.states[-1, 2]) < 6  # it turns less


@solver
def test_controllers_on_one_body_ask_for_nearly_the_same(rimac, generator):
    """F and the equations, to .002 rad of steer and of slip."""
    one, other = (CONTROLLERS[kind]().of(rimac, fit) for kind, fit in (("generator", generator), ("equations", None)))
    for x in ([20.0, 0.0, 1.0], [25.0, 2.0, 0.5], [12.0, -3.0, -1.0]):
        one.reset()
        other.reset()
        for _ in range(10):
            u = [control.step(np.array(x), AHEAD) for control in (one, other)]
        assert u[0] == pytest.approx(u[1], abs=2e-3)


@solver
def test_the_predictor_chooses_the_controller(rimac, generator, eigen):
    for fit in (generator, eigen):
        control = Controller(fit, rimac, steer_rear=0.0, weights=TRACKING)
        assert isinstance(control, Planner)
        assert control.step(X, AHEAD)[2] == 0.0


def test_a_predictor_that_no_controller_works_on(rimac, generator):
    linear = replace(generator, dynamics=_Linear())
    with pytest.raises(InvalidValueError, match="no controller works on a predictor with the dynamics 'linear'"):
        Controller(linear, rimac)


def test_settings_are_checked(rimac, generator):
    with pytest.raises(UsageError, match="steer_raer"):
        Controller(generator, rimac, steer_raer=0.0)
    with pytest.raises(InvalidValueError, match="steer_rear"):
        Controller(generator, rimac, steer_rear=-1.0)


class _Linear:
    kind = "linear"


@pytest.mark.parametrize(
    ("kind", "given", "says"),
    [
        ("generator", None, "needs a predictor"),
        ("eigen", None, "needs a predictor"),
        ("generator", "eigen", "needs a predictor with the dynamics 'generator', got 'diagonal'"),
        ("eigen", "generator", "needs a predictor with the dynamics 'diagonal' or 'force-driven', got 'generator'"),
    ],
)
def test_a_predictor_that_does_not_fit(kind, given, says, rimac, request):
    with pytest.raises(InvalidValueError, match=says):
        CONTROLLERS[kind]().of(rimac, request.getfixturevalue(given) if given else None)


def test_a_predictor_of_another_body_is_refused(rimac, generator):
    of_another = replace(generator, plant={"vehicle": {"m": 1500.0}})
    with pytest.raises(InvalidValueError, match=r"identified with m = 1500\.0, .* with 1300\.0"):
        CONTROLLERS["generator"]().of(rimac, of_another)


def test_a_generator_of_another_plant_is_refused(rimac, generator, eigen):
    of_slips = replace(generator, input_channels=eigen.input_channels)
    with pytest.raises(InvalidValueError, match=r"of the plant 'forces', got one of v_x, .* steer_f"):
        CONTROLLERS["generator"]().of(rimac, of_slips)


def test_eigenfunctions_of_another_state_are_refused(rimac, eigen):
    of_wheels = replace(eigen, state_channels=TorqueInput.states)
    with pytest.raises(
        InvalidValueError, match=r"needs a predictor of v_x, v_y, yaw_rate, got one of v_x, .* wheel_rate_r"
    ):
        CONTROLLERS["eigen"]().of(rimac, of_wheels)
    with pytest.raises(InvalidValueError, match="fitted to the horizon ahead, got Polynomial"):
        CONTROLLERS["eigen"]().of(rimac, replace(eigen, observables=Anisotropic(order=1).make(np.eye(3))))


@pytest.mark.parametrize("kind", sorted(CONTROLLERS))
def test_settings_are_written_and_read_again(kind):
    control = CONTROLLERS[kind]()
    if kind in ("eigen", "ltv"):
        control = replace(control, weights=TRACKING, steer_rear=0.0)
    assert restored(ControllerChoice, written(control)) == control
    assert restored(ControllerChoice, {"kind": kind, **essential(control)}) == control


@solver
def test_a_horizon_that_eigenfunctions_do_not_hold(rimac, eigen):
    with pytest.raises(InvalidValueError, match="75 steps are past the window"):
        CONTROLLERS["eigen"](steps=15).of(rimac, eigen)
    with pytest.raises(InvalidValueError, match="no multiple"):
        CONTROLLERS["eigen"](h=0.013).of(rimac, eigen)


@pytest.mark.parametrize("kind", ["equations", "ltv"])
def test_controllers_that_solve_need_the_solver(kind, rimac, monkeypatch):
    monkeypatch.setitem(sys.modules, "daqp", None)
    with pytest.raises(InvalidValueError, match=r"pip install 'koopcli\[control\]'"):
        CONTROLLERS[kind]().of(rimac)


@pytest.mark.parametrize("kind", ["esc", "none"])
def test_controllers_that_solve_nothing_do_without_it(kind, rimac, monkeypatch):
    monkeypatch.setitem(sys.modules, "daqp", None)
    u = CONTROLLERS[kind]().of(rimac).step(X, AHEAD)
    assert u == pytest.approx([-0.04, -0.03, 0.04, -0.03] if kind == "esc" else 0)


@pytest.mark.parametrize(
    ("x", "reference", "says"),
    [
        (np.zeros((1, 3)), AHEAD, "takes one state"),
        (X, np.zeros((2, 3)), "takes one state"),
        (np.array([np.nan, 0, 0]), AHEAD, "not finite"),
    ],
)
def test_a_step_from_what_is_no_state(x, reference, says, rimac):
    with pytest.raises(InvalidValueError, match=says):
        CONTROLLERS["esc"]().of(rimac).step(x, reference)
