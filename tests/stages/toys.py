"""Every stage on toy inputs that no other stage made, and what came out when its version was last raised.

``python -m tests.stages.toys`` (make pins) rewrites the pins; do so for a new toy, and for an old result that moved
only together with a new version of its stage.
"""

from __future__ import annotations

import json
import re
import sys
from dataclasses import MISSING, fields, is_dataclass, replace
from functools import cache, partial
from pathlib import Path

import numpy as np

from koopcli.checks import build
from koopcli.choices import Choice, written
from koopcli.config.declared import every_setting
from koopcli.config.pictures import Cone, Plot, Series, Subject, Tyres
from koopcli.config.settings import Baseline, Evaluate, Simulate, Sweep, SweepAxis
from koopcli.config.shipped import fingerprint
from koopcli.control.closed import ClosedLoop
from koopcli.control.controllers.esc import EscControl
from koopcli.figures.kit.registry import FIGURES
from koopcli.koopman.bases.orthonormal import OrthonormalPolynomials
from koopcli.koopman.bases.polynomial import Polynomial
from koopcli.koopman.edmd.fit import FitEdmd, fit_measured
from koopcli.koopman.eigen.fit import FitEigen
from koopcli.koopman.eigen.forces import force_matrix
from koopcli.koopman.eigen.futures import Futures
from koopcli.koopman.eigen.lookup.nearest import NearestLift
from koopcli.koopman.eigen.lookup.polyharmonic import PolyharmonicLift
from koopcli.koopman.eigen.nodes import Search, nodes_of
from koopcli.koopman.eigen.tabulated import Tabulated
from koopcli.koopman.predictor.coverage import Coverage
from koopcli.koopman.predictor.dynamics.bilinear import Bilinear
from koopcli.koopman.predictor.dynamics.diagonal import Diagonal
from koopcli.koopman.predictor.dynamics.force_driven import ForceDriven
from koopcli.koopman.predictor.dynamics.linear import Linear
from koopcli.koopman.predictor.modes import Modes
from koopcli.koopman.predictor.predictor import Predictor
from koopcli.koopman.predictor.regression import Regression
from koopcli.koopman.predictor.trust import Trust
from koopcli.koopman.scores.baselines import Forecast
from koopcli.koopman.scores.evaluation import Evaluation
from koopcli.koopman.scores.swept import SCORES, Swept
from koopcli.koopman.selection.record import Selection
from koopcli.koopman.selection.score import Score, score
from koopcli.koopman.selection.select import select
from koopcli.logs.files import expand
from koopcli.logs.imported import Log
from koopcli.logs.map import parse_map
from koopcli.progress import silent
from koopcli.records import Channels, Episodes, Meta, Packed, Sample, Trajectories
from koopcli.simulation.manoeuvres import MANOEUVRES
from koopcli.simulation.samples.ball import BallSample
from koopcli.simulation.samples.ball_forces import BallForcesSample
from koopcli.simulation.samples.box import BoxSample
from koopcli.simulation.samples.drive import DriveSample
from koopcli.simulation.samples.ellipsoid import EllipsoidSample
from koopcli.simulation.samples.greedy import GreedySample
from koopcli.simulation.samples.grid import GridSample
from koopcli.simulation.samples.manoeuvre import ManoeuvreSample
from koopcli.simulation.samples.point import PointSample
from koopcli.stages import control
from koopcli.stages.base import Context
from koopcli.stages.control import Loop
from koopcli.stages.logs import imported
from koopcli.stages.predict import Predict
from koopcli.stages.registry import STAGES
from koopcli.stages.score import OnLog
from koopcli.stages.select import Select
from koopcli.vehicles.parameters import MagicFormula, VehicleParameters
from koopcli.vehicles.plants.forces import ForceInput, Forces
from koopcli.vehicles.plants.slips import SlipInput, Slips
from koopcli.vehicles.plants.slips_axle_forces import AxleForces, ForceChange
from koopcli.vehicles.plants.wheels import TorqueInput, Wheels

control.CLOCK = lambda: 0.0  # what a step takes is no result
SIMULATED = Path(__file__).parents[2] / "data" / "logs" / "simulated"
PINS = Path(__file__).parents[1] / "golden" / "stages.json"
BEYOND = 1e12  # a condition number past this is rounding
TOLERANCE = 1e-6  # above what BLAS threads and processors change, below what any change of a method does
CAR = VehicleParameters(
    m=1200.0,
    Jzz=1500.0,
    l_f=1.2,
    l_r=1.5,
    c_w=0.3,
    A=2.0,
    rho=1.2,
    mu_scale=0.9,
    lateral=MagicFormula(B=8.0, C=1.4, mu=1.1, E=-0.5),
    longitudinal=MagicFormula(B=10.0, C=1.6, mu=1.2, E=0.3),
)
ON_WHEELS = replace(CAR, J_R=1.1, r_w=0.32, lateral_rear=MagicFormula(B=9.0, C=1.3, mu=1.2, E=-0.4, S_h=0.005))
STATES, INPUTS = ForceInput.states, ForceInput.inputs


def _sample() -> Sample:
    factors = tuple(np.array([-1.0, 0.2, 0.7, 1.3]) * half_width for half_width in (20, 15, 5))
    u = 100 * np.sin(np.arange(24.0) ** 2).reshape(6, 1, 4)
    return Sample(factors, np.empty((0, 3)), u, True, STATES, INPUTS)


def _trajectories(steps: int) -> Trajectories:
    x0, u = _sample().expand(steps)
    decay = np.exp(-0.1 * np.arange(steps + 1))[:, np.newaxis]
    x = x0[:, np.newaxis] * decay + 0.01 * np.sin(x0[:, np.newaxis, ::-1] * (1 - decay))
    x[:, 1:, :3] += 1e-3 * np.cumsum(u, axis=1)[:, :, :3]
    return Trajectories(x, u, 0.01, STATES, INPUTS, _sample().product)


def _flat() -> Trajectories:
    """Data whose inputs are dependent and whose states lie almost in a plane: the QR path, with a dropped direction."""
    full = _trajectories(2)
    x = np.array(full.x)
    x[:, :, 1] = 0.5 * x[:, :, 0] + 1e-4 * np.sin(x[:, :, 0])
    return Trajectories(x, np.repeat(full.u[:, :, :1], 4, axis=2), 0.01, STATES, INPUTS)


def _predictor(growth: float = 0.95) -> Predictor:
    axis = OrthonormalPolynomials(0.5, 20.0, np.array([0.1]), np.array([1.0, 0.6]))
    basis = Polynomial((axis, axis, axis), np.array(list(np.ndindex(2, 2, 2))))
    A = growth * np.eye(8) + 0.01 * np.cos(np.arange(64.0)).reshape(8, 8)
    B = 1e-4 * np.sin(np.arange(32.0)).reshape(8, 4)
    found = Regression(12, 12, 1.0)
    return Predictor(basis, Linear(A, B), basis.state_map, 0.01, _coverage(), STATES, INPUTS, found)


def _coverage() -> Coverage:
    domain = np.array([[-20.0, -20, -20], [30, 30, 30]])
    box = np.hstack([np.vstack([np.eye(3), -np.eye(3)]), -np.ones((6, 1))])
    return Coverage(_sample().x0, domain, box)


def _gliding(steps: int = 12) -> Trajectories:
    """Trajectories without inputs that leave their initial states for good, one of them twice."""
    t = 0.01 * np.arange(steps + 1)
    x0 = np.array([[20.0, 3, 1], [15, -8, 2], [-10, 12, -3], [18, 2, -4], [20, 3, 1]])
    x = x0[:, np.newaxis] * np.exp(-np.outer(t, [1.0, 2.0, 3.0])) + 0.3 * np.sin(x0[:, np.newaxis] * t[:, np.newaxis])
    return Trajectories(x, np.zeros((5, steps, 4)), 0.01, STATES, SlipInput.inputs)


def _swinging(steps: int = 30) -> Trajectories:
    """Trajectories of one pair of rates, two real ones and little else: the search for rates has one sharp minimum,
    which every processor finds alike.
    """
    t = 0.1 * np.arange(steps + 1)[:, np.newaxis]
    parts = np.stack([np.exp(-0.4 * t) * np.cos(6 * t), np.exp(-0.4 * t) * np.sin(6 * t), np.exp(-2.5 * t), 0 * t + 1])
    weights = 1 + np.sin(np.arange(60.0) ** 2).reshape(4, 5, 1, 3)
    little = np.sin(np.arange(5.0)[:, np.newaxis, np.newaxis] + 40 * t)
    x = 10 * (weights * parts[:, np.newaxis]).sum(axis=0) + 0.05 * little
    return Trajectories(x, np.zeros((5, steps, 4)), 0.1, STATES, SlipInput.inputs)


def _looked_up() -> Predictor:
    """A pair of complex rates and a real one, two boundary functions, looked up at three trajectories."""
    modes = Modes(np.array([-1 + 5j, -1 - 5j, -0.5]), np.array([0.0, 2.0]), 2, 0.01)
    starts = 1 + np.sin(np.arange(18.0)).reshape(3, 2, 3)
    C = 10 * np.cos(np.arange(18.0)).reshape(3, 6)
    states = 3 * np.sin(np.arange(45.0) ** 2).reshape(3, 5, 3)
    lift = Tabulated(states, nodes_of(states, states.shape[1], Search(NearestLift(), np.ones(3))), starts, modes)
    regression = Regression(5, 6, 1e3, missed=0.7)
    found = Predictor(lift, Diagonal(modes, 4), C, 0.01, _coverage(), STATES, INPUTS, regression, horizon=8)
    trust = Trust(states.reshape(15, 3), 1 + np.arange(15.0), np.ones(3), 0.5, 1.5)
    return replace(found, trust=trust)


def _calm() -> Trajectories:
    data = _trajectories(4)
    return Trajectories(data.x, 0 * data.u, data.dt, STATES, INPUTS)


def _steered() -> Trajectories:
    data = _trajectories(4)
    return Trajectories(data.x, 1e-3 * np.asarray(data.u), data.dt, STATES, INPUTS)


def _plant(kind: str) -> Meta:
    """The plant of ``CAR`` as trajectories remember it."""
    vehicle = {**vars(CAR), "lateral": vars(CAR.lateral), "longitudinal": vars(CAR.longitudinal)}
    return {"plant": kind, "v_eps": 0.1, "vehicle": vehicle}


def _forecast(kind: str) -> Forecast:
    return Forecast(kind, 0.01, _coverage(), STATES, INPUTS, _plant("slips"))


def _pushed() -> Trajectories:
    """Under changes of axle forces."""
    data = _trajectories(4)
    u = 20 * np.asarray(data.u)
    return Trajectories(data.x, u, data.dt, STATES, ForceChange.inputs, plant=_plant("axle-forces"))


def _force_driven() -> Predictor:
    """Lifted states of two modes, looked up by splines, and forces that drive them."""
    modes = Modes(np.array([-1.0, -0.2]), np.array([0.0]), 3, 0.01)
    states = _trajectories(9).x[::6]
    nodes = nodes_of(states, 4, Search(PolyharmonicLift(neighbours=12), np.array([20.0, 15.0, 5.0])))
    lift = Futures(states, nodes, "world", np.sin(np.arange(14.0)).reshape(2, 7) / 4, modes)
    C = np.cos(np.arange(18.0)).reshape(3, 6)
    dynamics = ForceDriven(modes, 4, force_matrix(CAR), "every", 2)
    found, inputs = Regression(2, 2, 1.0, missed=0.7), ForceChange.inputs
    return Predictor(lift, dynamics, C, 0.01, _coverage(), STATES, inputs, found, horizon=6, plant=_plant("slips"))


def _bilinear() -> Predictor:
    linear, N = _predictor().dynamics, 1e-3 * np.cos(np.arange(256.0) ** 2).reshape(4, 8, 8)
    return replace(_predictor(), dynamics=Bilinear(linear.A, linear.B, N))


def _evaluation() -> Evaluation:
    t = np.arange(10.0)
    return Evaluation(
        x0=np.outer(t, [1.0, 2, 3]),
        rmse=t,
        rmse_printed=t,
        rmse_relift=t,
        start_error=t / 2,
        max_error=np.outer(t, [1.0, 2, 3]),
        in_domain=t / 10,
        distance=np.sin(t),
        outside=t > 5,
        bound=t * 1.2 + 0.1 * np.sin(t),
        diverged=t > 8,
        diverged_relift=t > 7,
        start=np.zeros(10, dtype=int),
        steps=4,
        first=1,
        functions=8,
        state_channels=STATES,
    )


def _slid() -> Sample:
    u = 0.1 * np.sin(np.arange(12.0) ** 2).reshape(3, 1, 4)
    return Sample((), np.array([[20.0, 1, 2], [-5, 3, -8], [0.01, -2, 5]]), u, False, STATES, SlipInput.inputs)


def _shoved() -> Sample:
    """The same states under changes of axle forces."""
    u = 3000 * np.sin(np.arange(12.0) ** 2).reshape(3, 1, 4)
    return Sample((), _slid().x0, u, False, STATES, ForceChange.inputs)


def _driven() -> Sample:
    """On wheels: under way, in a skid in reverse, and nearly at rest on spinning wheels."""
    u = np.sin(np.arange(18.0) ** 2).reshape(3, 1, 6) * [0.1, 300, 300, 0.05, 300, 300]
    u[..., 2::3] = np.abs(u[..., 2::3])
    x0 = np.array([[20.0, 1, 0.5, 60, 61], [-5, 3, -2, -10, -20], [0.01, -0.2, 0.1, 5, 8]])
    return Sample((), x0, u, False, TorqueInput.states, TorqueInput.inputs)


def _few() -> Trajectories:
    """As many trajectories as the evaluation has scores."""
    data = _calm()
    return Trajectories(data.x[5:15], data.u[5:15], data.dt, STATES, INPUTS)


def _on_a_surface() -> Sample:
    """Nine states, three latitudes of three, on the ellipsoid of semi-axes 20, 10 and 5."""
    up, around = np.meshgrid([-1.0, 0.0, 1.0], [0.0, 2.0, 4.0], indexing="ij")
    points = np.stack([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)], axis=-1)
    return Sample((), points.reshape(9, 3) * [20.0, 10, 5], np.zeros((9, 1, 4)), False, STATES, SlipInput.inputs)


def figure_settings(name: str) -> Plot:
    """The figure ``name`` of one toy, or of two where it draws several."""
    kind = FIGURES[name]
    labels = {"one": (), "beside": ("one", "another"), "points": ("one", "one")}[kind.draws]
    told = {
        "restart": 3,
        "trajectory": 1,
        "cones": (Cone(0.0, 1.0), Cone(0.0, -1.0)),
        "tyres": tuple(
            Tyres(label, loads, 0.9, 2 * (CAR.lateral,), 2 * (CAR.longitudinal,))
            for label, loads in (("even", (3000.0, 3000.0)), ("nose-heavy", (4000.0, 3000.0)))
        ),
    }
    return build(
        Plot,
        {
            "figure": name,
            "format": "png",
            "drawn_by": "",
            "of": Subject((fingerprint(CAR, Slips.uses()),), ("EDMD, order 1",)),
            "series": tuple(Series(label, i + 3 if kind.draws == "points" else None) for i, label in enumerate(labels)),
            **{field: told[field] for field in kind.told},
        },
    )


def figure_records(name: str) -> dict:
    """What the figure of :func:`figure_settings` draws."""
    kind = FIGURES[name]
    records = {
        "evaluation": _evaluation(),
        "predictor": _predictor() if kind.takes in ("predictor", "fit") else _looked_up(),
        "trajectories": _trajectories(7) if kind.takes in ("predictor", "trajectories") else _few(),
        "training": _gliding(),
        "sample": _on_a_surface(),
        "sweep": _swept(),
        "loop": _loop(),
        "log": _log(),
        "selection": _selection(),
        "score": _scored_log(),
    }
    if kind.takes == "score":
        records |= {"predictor": _of_log(), "trajectories": _log()}
    return {f"{i}/{role}": records[role] for i in range(1 if kind.draws == "one" else 2) for role in kind.roles}


def _swept() -> Swept:
    """Orders by terms by seeds, one cell of which has no error."""
    places = [(i, j, k) for i in range(3) for j in range(2) for k in range(2)]
    mean = np.array([10.0 / (1 + i) ** (1 + j) + k for i, j, k in places])
    mean[-1] = np.nan
    scores = {name: mean * (1 + n) for n, name in enumerate(SCORES)}
    counts = dict.fromkeys(("functions", "trajectories", "diverged"), np.arange(12.0))
    names = ("fit-edmd.order", "fit-edmd.terms", "sample.seed")
    return Swept(names, (("1", "2", "4"), ("linear", "bilinear"), ("0", "1")), np.array(places), {**scores, **counts})


@cache
def _log() -> Log:
    """Two recordings of a car in small: a speed that a pedal drives, and a yaw rate that steer and speed drive."""
    t = 0.05 * np.arange(900.0)
    u = np.stack([np.sin(0.9 * t) + 0.5 * np.sin(2.3 * t + 1), 0.1 * np.sin(1.7 * t) + 0.05 * np.sin(3.1 * t)], axis=1)
    x = np.empty((900, 2))
    x[0] = 15.0, 0.0
    for k in range(899):
        speed, turn = x[k]
        x[k + 1] = speed + 0.05 * (2 * u[k, 0] - 0.1 * (speed - 15)), turn + 0.3 * (0.25 * speed * u[k, 1] - turn)
    channels = Channels(("v_x", "yaw_rate"), ("m/s", "rad/s")), Channels(("pedal", "steer"), ("1", "rad"))
    bounds, starts, runs = np.array([0, 350, 900]), np.array([1.0, 30.0]), np.array([0, 1])
    return Log(Episodes(x, u, 0.05, bounds, starts, runs, *channels), display={"yaw_rate": "deg/s", "steer": "deg"})


def _loop() -> ClosedLoop:
    """Two cars, the second of which never comes to rest."""
    t = 0.01 * np.arange(101.0)
    states = np.stack([np.stack([15 + 5 * np.exp(-t), np.exp(-2 * t), a * np.cos(5 * t)], axis=1) for a in (0.1, 2.0)])
    inputs = 0.1 * np.sin(np.arange(800.0)).reshape(2, 100, 4)
    whole = {"cpu": np.full((2, 100), 1e-3), "settled": np.array([0.9, np.inf]), "cost": np.array([3.0, 40.0])}
    counts = {"kkt": np.array([1e-9, 1e-7]), "unsolved": np.array([0, 3]), "ended": ("", "")}
    reference = np.tile([15.0, 0, 0], (101, 1))
    return ClosedLoop(states, reference, inputs, **whole, **counts, dt=0.01, solves=True, tracks=False)


@cache
def _selection() -> Selection:
    return select(_log().episodes, Select(bicycle=False).rungs)


@cache
def _scored_log() -> Score:
    return score(_of_log(), _of_log(0.0), _log().episodes, own=True)


@cache
def _of_log(memory: float = 0.2) -> Predictor:
    how = FitEdmd.of(basis="total", order=1, terms="products" if memory else "linear", memory=memory)
    return fit_measured(_log().episodes, how)


def _chunks(stage, settings, inputs):
    def chunks(count, size, given=None, each=0.0):
        rows = (slice(start, min(start + size, count)) for start in range(0, count, size))
        there = inputs if given is None else {**inputs, "given": given}
        return [STAGES[stage].chunk(settings, there, one, silent) for one in rows]

    return chunks


_scored = partial(Evaluate, relift=True)

TOYS = {
    "sample": [
        (GridSample(seed=3, count=4, columns=2), {}),
        (GridSample(seed=3, count=4, columns=2, draw="even"), {}),
        (BoxSample(count=5, steps=3), {}),
        (BoxSample(count=5, excitation="held"), {}),
        (EllipsoidSample(count=16, m=1200.0, Jzz=1500.0), {}),
        (EllipsoidSample(count=15, mesh="fibonacci", energy=1e5, m=1200.0, Jzz=1500.0), {}),
        (BallSample(count=5, m=1200.0, Jzz=1500.0), {}),
        (PointSample(steps=4), {}),
        (PointSample(x0=(3.0, 2.0, 1.0), excitation="held", seed=5), {}),
        (GridSample(seed=3, count=4, columns=2, draw="chebyshev"), {}),
        (EllipsoidSample(count=12, mesh="fibonacci", shells=3, m=1200.0, Jzz=1500.0), {}),
        (DriveSample(count=4, r_w=0.3), {}),
        (DriveSample(count=4, r_w=0.3, excitation="fresh", steps=3, seed=2), {}),
        *((ManoeuvreSample(name=name, vehicle=ON_WHEELS, dt=0.05).settled(), {}) for name in MANOEUVRES),
        (
            GreedySample(
                budget=4.0,
                steps=10,
                usable=0.05,
                candidates=200,
                mirror=("left-right",),
                vehicle=CAR,
                dt=0.01,
                v_eps=0.1,
                combined="none",
            ),
            {},
        ),
        (BallForcesSample(count=3, steps=7, hold=3, vehicle=CAR), {}),
    ],
    "simulate": [
        (Simulate(vehicle=CAR).settled(Forces(), 3), {"sample": _sample()}),
        (Simulate(vehicle=CAR, dt=0.02).settled(Forces("wheel"), 2), {"sample": _sample()}),
        (Simulate(vehicle=CAR).settled(Slips(), 40), {"sample": _slid()}),
        (Simulate(vehicle=ON_WHEELS).settled(Wheels(), 20), {"sample": _driven()}),
        (
            Simulate(vehicle=ON_WHEELS).settled(Wheels(0.3, "none"), 3),
            {"sample": _driven()},
        ),
        (Simulate(vehicle=ON_WHEELS, reference=True).settled(Wheels(), 3), {"sample": _driven()}),
        (Simulate(vehicle=CAR, noise=0.1, noise_seed=2).settled(Slips(), 3), {"sample": _slid()}),
        (Simulate(vehicle=CAR, noise=0.1, noise_memory=0.8).settled(Slips(), 3), {"sample": _slid()}),
        (Simulate(vehicle=CAR).settled(AxleForces(combined="ellipse"), 20), {"sample": _shoved()}),
    ],
    "fit-edmd": [
        (FitEdmd.of(order=2), {"trajectories": _trajectories(1)}),
        (FitEdmd.of(order=2), {"trajectories": _trajectories(3)}),
        (FitEdmd.of(order=1), {"trajectories": _flat()}),
        (FitEdmd.of(basis="states"), {"trajectories": _gliding()}),
        (FitEdmd.of(basis="anisotropic", order=2, terms="bilinear", ridge=1e-3), {"trajectories": _trajectories(1)}),
        (FitEdmd.of(basis="total", order=2, terms="bilinear"), {"trajectories": _trajectories(3)}),
        (FitEdmd.of(basis="thin-plate", centres=5, placement="drawn", seed=2), {"trajectories": _trajectories(1)}),
        (FitEdmd.of(basis="total", order=1, terms="generator"), {"trajectories": _trajectories(1)}),
        (FitEdmd.of(order=1, solver="cholesky-monomials"), {"trajectories": _trajectories(1)}),
    ],
    "fit-eigen": [
        (FitEigen.of(centres=4, tabulate=0.05, cut=1e-6), {"trajectories": _gliding()}),
        (FitEigen.of(centres=6, tabulate=0.05, cut=1e-6, scaling="extent", seed=3), {"trajectories": _gliding()}),
        (FitEigen.of(boundary="optimal", degree=1, tabulate=0.04), {"trajectories": _gliding()}),
        (
            FitEigen.of(
                boundary="optimal", eigenvalues="comb", pairs=1, cut=1e-8, tabulate=0.05, lift="linear", nodes=4
            ),
            {"trajectories": _gliding()},
        ),
        (
            FitEigen.of(
                eigenvalues="comb",
                pairs=1,
                cut=1e-8,
                window="horizon",
                horizon=0.5,
                tabulate=2.8,
                lift="mls",
                coordinates="world",
                rounds=1,
                neighbours=8,
                radial_power=0.7,
                trust=True,
            ),
            {"trajectories": _swinging()},
        ),
        (
            FitEigen.of(
                eigenvalues="varpro",
                pairs=1,
                cut=1e-6,
                window="horizon",
                tabulate=0.5,
                lift="polyharmonic",
                neighbours=12,
                spacing=2,
            ),
            {"trajectories": _swinging()},
        ),
        (
            FitEigen.of(
                eigenvalues="comb",
                pairs=1,
                cut=1e-8,
                window="horizon",
                tabulate=0.5,
                lift="polyharmonic",
                neighbours=12,
                inputs="forces",
                input_matrix="between",
                every=4,
            ),
            {"trajectories": replace(_swinging(), plant=_plant("slips"))},
        ),
    ],
    "baseline": [
        (Baseline(), {"trajectories": _gliding()}),
        (Baseline(kind="linearisation"), {"trajectories": _trajectories(1)}),
    ],
    "evaluate": [
        (_scored(chunk=100, first=1), {"predictor": _predictor(), "trajectories": _trajectories(4)}),
        (
            _scored(chunk=100, first=1),
            {"predictor": _predictor(growth=250.0), "trajectories": _trajectories(4)},
        ),
        (_scored(chunk=100, first=0), {"predictor": _looked_up(), "trajectories": _calm()}),
        (_scored(chunk=100, first=1), {"predictor": _bilinear(), "trajectories": _trajectories(4)}),
        *(
            (_scored(chunk=100, first=0), {"predictor": _forecast(kind), "trajectories": _calm()})
            for kind in ("hold", "rotation", "linearisation")
        ),
        (
            _scored(chunk=2, first=1, restart=3),
            {"predictor": _bilinear(), "trajectories": _trajectories(4)},
        ),
        (
            _scored(chunk=100, first=0),
            {"predictor": _forecast("linearisation"), "trajectories": _steered()},
        ),
        *(
            (_scored(chunk=100, first=0, **asked), {"predictor": _force_driven(), "trajectories": _pushed()})
            for asked in ({}, {"input_matrix": "between"}, {"every": 3}, {"input_matrix": "relift"})
        ),
        (_scored(chunk=100, first=0), {"predictor": _forecast("linearisation"), "trajectories": _pushed()}),
    ],
    "sweep": [
        (
            Sweep(
                (SweepAxis("fit-edmd.order", ("1", "2")), SweepAxis("fit-edmd.terms", ("linear",))), ((0, 0), (1, -1))
            ),
            {f"{i}/evaluation": _evaluation().figures() for i in range(2)},
        )
    ],
    "import": [(imported(expand([str(SIMULATED)]), parse_map((SIMULATED / "map.toml").read_text())).settings, {})],
    "select": [
        (Select(bicycle=False), {"trajectories": _log()}),
        (Select(memory=(0.1, 0.2), order=(1, 2), blocks=2), {"trajectories": _log()}),
    ],
    "score": [(OnLog(), {"predictor": _of_log(), "dmdc": _of_log(0.0), "trajectories": _log()})],
    "predict": [
        (Predict(at=3.0, run=1, seconds=0.5), {"predictor": _of_log(), "trajectories": _log()}),
        (Predict(x0=(14.0, 0.1), u=((0.5, 0.05),) * 5, seconds=0.25), {"predictor": _of_log()}),
    ],
    "control": [
        (Loop(vehicle=ON_WHEELS, driven=ON_WHEELS, scenario="spin", controller=EscControl(), seconds=0.1), {}),
        (
            Loop(
                **{"vehicle": ON_WHEELS, "driven": CAR, "scenario": "random", "controller": EscControl(), "count": 2},
                **{"plant": "slips", "seconds": 0.1, "noise": 0.1, "delay": 2},
            ),
            {},
        ),
    ],
    "plot": [(figure_settings(name), figure_records(name)) for name in FIGURES],
}


Made = dict[str, tuple[Packed, Meta]]  # label of a toy -> what was made of it, and its figures


def made(stage: str) -> Made:
    """What the stage makes of its toys. A toy is labelled by its settings' own name, or by its place among the others,
    so that a new one between them is no change of the old.
    """
    found: Made = {}
    for settings, inputs in TOYS[stage]:
        record = STAGES[stage].run(
            settings, inputs, Context(silent, lambda text: None, _chunks(stage, settings, inputs))
        )
        name = getattr(settings, "figure", None) or getattr(settings, "name", None)
        found[name or str(sum(label.isdigit() for label in found))] = record.pack(), STAGES[stage].figures(record)
    return found


def results(made: Made) -> dict[str, list[float]]:
    """Size, sum and weighted sum of every array that was made, and its figures; no image bytes."""
    found = {}
    for label, (packed, figures) in made.items():
        found |= {f"{label}: holds {name}": [1.0] for name in packed.meta}
        for name, array in packed.arrays.items():
            if name != "image":
                values = np.asarray(array.values, dtype=float).ravel()
                weights = np.cos(np.arange(len(values)))
                values = np.nan_to_num(values, nan=-1.0, posinf=1e300, neginf=-1e300)
                found[f"{label}/{name}"] = [len(values), float(values.sum()), float(values @ weights)]
        for name, fact in figures.items():
            if isinstance(fact, (int, float)) and name != "bytes":
                found[f"{label}: {name}"] = [float(min(fact, BEYOND)) if np.isfinite(fact) else BEYOND]
    return found


def complaint(stage: str, pins: dict[str, dict], made: Made) -> str | None:
    """What is wrong between a stage, its version and the pinned result of its toys; None when nothing is."""
    pin, version = pins.get(stage), STAGES[stage].version
    if pin is None:
        return f"{stage} has no pinned result: pin it (make pins)"
    if version != pin["version"]:
        return f"{stage} has version {version}, pinned {pin['version']}: pin it (make pins)"
    now, old = results(made), pin["results"]
    labels, pinned = ({re.split("[:/]", name)[0] for name in of} for of in (now, old))
    kept = {name: values for name, values in now.items() if re.split("[:/]", name)[0] in pinned}
    expected = {name: values for name, values in old.items() if re.split("[:/]", name)[0] in labels}
    same = kept.keys() == expected.keys() and all(
        np.allclose(kept[name], values, rtol=TOLERANCE, atol=TOLERANCE * max(1e-3, min(1.0, max(map(abs, values)))))
        for name, values in expected.items()
    )
    if not same:
        return f"the result of {stage} changed: raise its version, then pin it afresh (make pins)"
    if labels != pinned:
        return f"{stage} has {'a new toy' if labels - pinned else 'lost a toy'}: pin it (make pins)"
    return None


def defaults() -> dict[str, dict[str, object]]:
    """The defaults of every stage's settings by their full names: what is at them is in no key."""
    of: dict[str, dict[str, object]] = {stage: {} for stage in STAGES}
    for setting in every_setting():
        section, default = setting.table.partition(".")[0], setting.field.default
        stages = {"test": ["sample"], "vehicle": ["sample", "simulate"]}.get(section, [section])
        if default is not MISSING:
            value = default.kind if isinstance(default, Choice) else default
            for stage in set(stages) & set(of):
                of[stage][setting.full_name.replace("test.", "sample.", 1)] = json.loads(json.dumps(value))
    for cls in (Plot, Series, Subject, MagicFormula):
        stage = "simulate" if cls is MagicFormula else "plot"
        of[stage] |= {
            f"{cls.__name__}.{f.name}": json.loads(json.dumps(None if f.default is MISSING else written_(f.default)))
            for f in fields(cls)
        }
    return of


def written_(value: object) -> object:
    return written(value) if is_dataclass(value) else value


def changed_defaults(pins: dict[str, dict], now: dict[str, dict[str, object]]) -> list[str]:
    """The defaults that are others than those that were pinned with the same version of their stage."""
    return [
        f"{stage}: {name} was {default!r}: raise its version, then pin it afresh (make pins)"
        for stage, pin in pins.items()
        if STAGES[stage].version == pin["version"]
        for name, default in pin["defaults"].items()
        if now[stage].get(name, "gone") != default
    ]


def write_pins() -> None:
    """Pin every stage's results and defaults beside its version; refuse what has changed at the same version."""
    old = json.loads(PINS.read_text())
    results_changed = (complaint(stage, old, made(stage)) for stage in STAGES if stage in old)
    wrong = [*changed_defaults(old, defaults()), *(text for text in results_changed if text and "raise" in text)]
    if wrong:
        sys.exit("\n".join(wrong))
    pins = {
        stage: {"version": STAGES[stage].version, "defaults": defaults()[stage], "results": results(made(stage))}
        for stage in STAGES
    }
    PINS.write_text(json.dumps(pins, indent=1) + "\n")


if __name__ == "__main__":
    write_pins()
