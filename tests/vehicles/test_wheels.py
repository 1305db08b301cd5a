"""The plant on wheels: torques and steer."""

from __future__ import annotations

from dataclasses import replace
from math import atan, atan2, cos, hypot, sin, sqrt, tanh

import numpy as np
import pytest

from koopcli.config.shipped import vehicle_named
from koopcli.errors import InvalidValueError
from koopcli.simulation.integrate import LARGEST, integrate, simulate
from koopcli.vehicles.handling import steady_steer, wheel_poles
from koopcli.vehicles.parameters import MagicFormula
from koopcli.vehicles.plants.slips import SlipInput
from koopcli.vehicles.plants.wheels import TorqueInput
from koopcli.vehicles.tyre import ellipse

MIRROR_X, MIRROR_U = np.array([1, -1, -1, 1, 1]), np.array([-1, 1, 1, -1, 1, 1])
VEHICLES = ("ctu-2020", "rimac-2018", "efremov-2020", "bmw-320i")


@pytest.fixture(scope="module", params=VEHICLES)
def plant(request) -> TorqueInput:
    return TorqueInput(vehicle_named(request.param))


@pytest.fixture(scope="module")
def odd() -> TorqueInput:
    """Axles and tyres that differ, a shift that only the mirrored right wheels undo."""
    rear = MagicFormula(B=9.0, C=1.4, mu=1.3, E=-0.5, S_h=0.01)
    other = MagicFormula(B=12.0, C=1.5, mu=0.9, E=0.1)
    car = vehicle_named("efremov-2020")
    lateral = replace(car.lateral, S_h=-0.02)
    return TorqueInput(replace(car, lateral=lateral, lateral_rear=rear, longitudinal_rear=other, mu_scale=0.8))


@pytest.fixture(scope="module")
def states() -> np.ndarray:
    """Forwards and in reverse, sliding and spinning wheels."""
    return np.random.default_rng(1).uniform(-1, 1, (300, 5)) * [30, 10, 3, 120, 120]


@pytest.fixture(scope="module")
def inputs() -> np.ndarray:
    u = np.random.default_rng(2).uniform(-1, 1, (300, 6)) * [0.3, 800, 800, 0.1, 800, 800]
    u[:, [2, 5]] = np.abs(u[:, [2, 5]])
    return u


def run(plant, x0, u, seconds, finer=1):
    x0, u = np.atleast_2d(x0), np.atleast_2d(u)
    u = np.repeat(np.broadcast_to(u, (len(x0), 6))[:, np.newaxis], round(seconds / 0.01), axis=1)
    return simulate(plant.rhs, x0, u, 0.01, fastest_rate=lambda *now: finer * plant.fastest_rate(*now))


def rolling(plant, *speeds):
    r_w = plant.parameters.r_w
    return np.array([[v, 0.0, 0.0, v / r_w, v / r_w] for v in speeds])


@pytest.mark.parametrize(
    ("combined", "expected", "tolerance"),
    [
        (
            "none",
            [1.011790513227594, -5.870642237143493, 0.1588710002858145, 386.4488445346245, -333.0840153668796],
            1e-12,
        ),
        (
            "ellipse",
            [1.018542805630761, -5.870601351179212, 0.1560911111952434, 384.9983904902982, -332.9483502368450],
            1e-11,
        ),
    ],
)
def test_golden_vectors(combined, expected, tolerance):
    """From an independent implementation of the same equations, met by a second one."""
    plant = TorqueInput(vehicle_named("efremov-2020"), v_eps=0.1, combined=combined)
    found = plant.rhs(np.array([20, 0.5, 0.3, 60, 62.0]), np.array([0.05, 100, 0, 0, 150, 0.0]))
    assert found == pytest.approx(expected, rel=tolerance, abs=0)


def test_by_hand():
    """Plain scalars and the textbook's form of the ellipse, with what the golden vectors leave out: peaks that differ,
    a speed below v_eps, brakes near standstill, rear steer, reverse.
    """
    car = vehicle_named("bmw-320i")
    v_x, v_y, r, rates = -0.3, 0.2, 0.4, (1.5, -0.8)
    steers, drives, brakes, v_eps, width = (0.3, -0.2), (40.0, 10.0), (100.0, 250.0), 0.5, 1.0
    sum_x, along, across = 0.0, [], []
    for i, (arm, share) in enumerate(((car.l_f, car.l_r), (-car.l_r, car.l_f))):
        load = car.m * 9.81 * share / (2 * (car.l_f + car.l_r))
        at_y, rim = v_y + arm * r, car.r_w * rates[i]
        w_x = cos(steers[i]) * v_x + sin(steers[i]) * at_y
        w_y = cos(steers[i]) * at_y - sin(steers[i]) * v_x
        alpha = -atan2(w_y, max(abs(w_x), v_eps))
        kappa = (rim - w_x) / max(abs(rim), abs(w_x), v_eps)
        pure = []
        for tyre, slip in ((car.longitudinal, kappa), (car.lateral, alpha)):
            b = tyre.B * slip
            pure.append(tyre.mu * load * sin(tyre.C * atan(b - tyre.E * (b - atan(b)))))
        tangent = abs(sin(alpha) / kappa)
        F_x = pure[0] / sqrt(1 + (pure[0] * tangent / (car.lateral.mu * load)) ** 2)
        F_y = pure[1] / sqrt(1 + (pure[1] / tangent / (car.longitudinal.mu * load)) ** 2)
        along.append(F_x)
        sum_x += 2 * (cos(steers[i]) * F_x - sin(steers[i]) * F_y)
        across.append(2 * (sin(steers[i]) * F_x + cos(steers[i]) * F_y))
    assert hypot(v_x, v_y) < v_eps
    turning = [(drives[i] - brakes[i] * tanh(rates[i] / width) - car.r_w * along[i]) / car.J_R for i in range(2)]
    expected = [
        sum_x / car.m + r * v_y,
        sum(across) / car.m - r * v_x,
        (car.l_f * across[0] - car.l_r * across[1]) / car.Jzz,
        *turning,
    ]
    u = np.array([steers[0], drives[0], brakes[0], steers[1], drives[1], brakes[1]])
    assert TorqueInput(car).rhs(np.array([v_x, v_y, r, *rates]), u) == pytest.approx(expected, rel=1e-13)


@pytest.mark.parametrize("steer", [0.0, 0.1])
def test_wheels_held_at_no_slip_are_the_slip_plant(plant, states, steer):
    """The three-state plant is the body of the five-state one."""
    slips = SlipInput(plant.parameters, plant.v_eps, plant.combined)
    x = states.copy()
    along = x[:, 1:2] + x[:, 2:3] * [plant.parameters.l_f, -plant.parameters.l_r]
    turned = np.array([steer, -steer / 2])
    x[:, 3:] = (np.cos(turned) * x[:, :1] + np.sin(turned) * along) / plant.parameters.r_w
    torque, slip = (
        np.tile([turned[0], 0, 0, turned[1], 0, 0.0], (300, 1)),
        np.tile([turned[0], 0, turned[1], 0.0], (300, 1)),
    )
    assert plant.rhs(x, torque)[:, :3] == pytest.approx(slips.rhs(x[:, :3], slip), rel=1e-11, abs=1e-9)


def test_mirror_symmetry(plant, odd, states, inputs):
    """To rounding, with shifts of the tyres too: the right wheels have the mirror image of the left ones'."""
    for one in (plant, odd):
        found, mirrored = one.rhs(states, inputs), one.rhs(states * MIRROR_X, inputs * MIRROR_U)
        assert mirrored == pytest.approx(found * MIRROR_X, rel=1e-12, abs=1e-11)


def test_a_shift_of_one_kind_of_wheel_would_pull_the_car_aside(odd):
    """What mirroring is for: straight ahead both wheels of an axle push against one another."""
    x = rolling(odd, 20.0)
    assert odd.rhs(x, np.zeros((1, 6)))[0, 1:3] == pytest.approx([0, 0], abs=1e-12)
    from koopcli.vehicles.tyre import force

    assert abs(force(odd.parameters.lateral, np.zeros(1), 3000.0)[0]) > 100


def test_the_ellipse_between_its_axes():
    F_x, F_y, D = np.array([2000.0]), np.array([-1500.0]), np.array([3000.0])
    only_along, only_across = (
        ellipse(F_x, 0 * F_y, np.array([0.1]), np.zeros(1), D, D),
        ellipse(0 * F_x, F_y, np.zeros(1), np.array([0.1]), D, D),
    )
    assert (only_along[0], only_across[1]) == (F_x, F_y)
    assert ellipse(0 * F_x, 0 * F_y, np.zeros(1), np.zeros(1), D, D) == (0, 0)
    slip, angle = np.random.default_rng(0).uniform(-1, 1, (2, 500))
    D_x, D_y = np.full(500, 3000.0), np.full(500, 2500.0)
    full = ellipse(D_x * np.sign(slip), D_y * np.sign(angle), slip, angle, D_x, D_y)
    assert (full[0] / D_x) ** 2 + (full[1] / D_y) ** 2 == pytest.approx(np.ones(500))  # sliding fully it is the ellipse


@pytest.mark.parametrize("kind", ["rolling", pytest.param("anything", marks=pytest.mark.slow)])
def test_energy_of_body_and_wheels_never_grows(plant, states, kind):
    """Without torque and steer, forwards and in reverse, whatever the wheels do at first."""
    x0 = rolling(plant, *np.linspace(-30, 30, 41)) if kind == "rolling" else states
    x0 = x0 + np.array([0, 0.5, 0.2, 0, 0])
    energy = plant.kinetic_energy(run(plant, x0[::3], np.zeros(6), 0.1))
    assert (np.diff(energy, axis=1) <= 1e-9 * energy[:, :1]).all()
    assert (energy[:, -1] < energy[:, 0]).all()


@pytest.mark.slow
def test_at_standstill_no_state_moves(plant):
    for u in (np.zeros(6), np.array([0.3, 0, 0, -0.1, 0, 0]), np.array([0.0, 0, 500, 0, 0, 500])):  # brakes hold it too
        assert not run(plant, np.zeros(5), u, 0.5).any()


@pytest.mark.slow
def test_halving_the_substeps_moves_the_body_by_less_than_a_thousandth(plant):
    """Every speed under every input."""
    speeds = np.array([1.0, 5.0, 30.0])
    x0 = rolling(plant, *speeds) + speeds[:, np.newaxis] * [0, 0.05, 0, 0, 0] + [0, 0, 0.1, 5.0, -3.0]
    u = np.array([[0, 0, 0, 0, 0, 0.0], [0.05, 200, 0, 0.01, 0, 300.0], [-0.1, 0, 600, 0, 0, 600.0]])
    x0, u = np.repeat(x0, 3, axis=0), np.tile(u, (3, 1))
    chosen, halved = run(plant, x0, u, 0.3), run(plant, x0, u, 0.3, finer=2)
    assert np.abs(chosen - halved)[:, -1, :3].max() <= 1e-3


@pytest.mark.slow
def test_one_step_a_sample_chatters(plant):
    """What the substeps are for: at 1 m/s the wheel flips from side to side, and nothing blows up to say so."""
    x0, u = rolling(plant, 1.0), np.tile([0.1, 0, 300.0, 0, 0, 300.0], (1, 30, 1))
    single = simulate(plant.rhs, x0, u, 0.01)
    assert np.isfinite(single).all()
    assert np.abs(single - run(plant, x0, u[0, 0], 0.3))[0, -1, :3].max() > 0.3


def test_the_rate_is_the_stiffness_of_the_plant(plant):
    """Against the Jacobian of a car that rolls, where nothing can change."""
    for speed in (0.1, 1.0, 5.0, 30.0):
        x, u = rolling(plant, speed), np.zeros((1, 6))
        J = np.stack([(plant.rhs(x + d, u) - plant.rhs(x - d, u))[0] / 2e-7 for d in 1e-7 * np.eye(5)], axis=1)
        stiffest = np.abs(np.linalg.eigvals(J)).max()
        rate = plant.fastest_rate(x, u, 0.0)[0]
        assert 0.95 * stiffest <= rate <= 1.5 * stiffest
        assert max(wheel_poles(plant.parameters, speed, plant.v_eps)) == pytest.approx(rate, rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("name", [*VEHICLES, "odd"])
def test_a_steady_turn_is_that_of_the_linear_car(name, odd):
    """Yaw rate per steer v / (L + K v²) within 1 % at small steer; ``odd`` has K ≠ 0."""
    one = odd if name == "odd" else TorqueInput(vehicle_named(name))
    gliding = replace(one, parameters=replace(one.parameters, c_w=0.0))
    u = [[steady_steer(gliding.parameters, v, 0.2), 0, 0, 0, 0, 0] for v in (8.0, 20.0)]
    end = run(gliding, rolling(gliding, 8.0, 20.0), u, 4.0)[:, -1]
    assert end[:, 2] == pytest.approx(0.2 / end[:, 0], rel=0.01)


ROUGH = np.array(
    [
        ([20, 0, 0, 0, 0], [0, 0, 3000, 0, 0, 3000]),  # locked wheels that are braked
        ([20, 0, 0, 0, 0], [0, 1000, 3000, 0, 1000, 3000]),  # and driven
        ([0, 0, 0, 0, 0], [0.3, 2000, 0, 0, 2000, 0]),  # a start from standstill with everything
        ([-15, 1, 0.3, -45, -45], [0.1, 0, 800, 0, 300, 0]),  # in reverse
        ([10, 2, 10, 30, 30], [0.3, 500, 0, 0, 500, 0]),  # spinning at 10 rad/s
        ([0, 0, 10, 0, 0], [0, 0, 0, 0, 0, 0]),
        ([0, 0, 0, 200, -200], [0, 0, 0, 0, 0, 0]),  # wheels against one another
    ],
    dtype=[("x0", float, 5), ("u", float, 6)],
)


@pytest.mark.slow
def test_rough_treatment_stays_finite():
    plant = TorqueInput(vehicle_named("rimac-2018"))
    x = run(plant, ROUGH["x0"], ROUGH["u"], 1.0)
    assert np.isfinite(x).all()
    assert np.abs(x[..., :2]).max() < 100
    finer = run(plant, ROUGH["x0"], ROUGH["u"], 0.3, finer=2)
    assert np.abs(x[:, 30, :3] - finer[:, -1, :3]).max() < 5e-3


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e300])
def test_states_that_are_none_end_their_trajectory_with_a_reason(plant, bad):
    x0 = rolling(plant, 10.0, 20.0, 30.0)
    x0[1, 2] = bad
    x, course = integrate(plant.rhs, x0, np.zeros((3, 5, 6)), 0.01, fastest_rate=plant.fastest_rate)
    assert course.reason.tolist() == [0, 1, 0]
    assert course.steps.tolist() == [5, 0, 5]
    assert np.isfinite(x[[0, 2]]).all()
    assert np.isnan(x[1, 1:]).all()
    u = np.zeros((3, 5, 6))
    u[1, 2, 1] = bad
    x, course = integrate(plant.rhs, rolling(plant, 10.0, 20.0, 30.0), u, 0.01, fastest_rate=plant.fastest_rate)
    assert course.reason[1] > 0
    assert course.steps[1] == 2
    assert (np.abs(x[1, :3]) < LARGEST).all()


def test_a_vehicle_without_wheels_is_refused(vehicle):
    for missing in ("J_R", "r_w"):
        with pytest.raises(InvalidValueError, match="inertia J_R and radius r_w"):
            TorqueInput(replace(vehicle, **{missing: None}))
    with pytest.raises(InvalidValueError, match=r"'wheels' needs a vehicle with tyres"):
        TorqueInput(replace(vehicle, lateral=None, longitudinal=None))
