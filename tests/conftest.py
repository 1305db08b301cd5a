"""Fixtures: the command line in this process, a store in a folder of its own, small data."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, settings

from koopcli.__main__ import main
from koopcli.checks import COMMAND_LINE
from koopcli.config.data import locate
from koopcli.koopman.eigen import fit as eigenfunctions
from koopcli.koopman.predictor.predictor import Predictor
from koopcli.records import Sample, Trajectories
from koopcli.simulation import sampling
from koopcli.simulation.integrate import simulate
from koopcli.stages.registry import STAGES
from koopcli.store import Store
from koopcli.vehicles.parameters import VehicleParameters, change, read_vehicle
from koopcli.vehicles.plants import Plant
from koopcli.vehicles.plants.forces import ForceInput
from koopcli.vehicles.plants.slips import SlipInput
from tests import stock

settings.register_profile("any load", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("any load")

OF_LOGS = {"import", "select", "predict", "control"}  # commands that take no experiment
TINY = """
[sample.grid]
count = 5
columns = 2
[sample.ellipsoid]
count = 25
steps = 30
[fit-edmd]
order = 2
[fit-edmd.basis.thin-plate]
centres = 20
[fit-eigen]
centres = 20
tabulate = 0.2
[test.box]
count = 40
steps = 5
[test.ball]
count = 40
steps = 5
[evaluate]
chunk = 20
[reproduce]
orders = [1, 2]
draw_seeds = [0]
training_forces = [1e4]
full_draws = 2
excitations = ["none", "fresh"]
seeds = [0, 1]
cuts = [1e-8]
mu_scales = [2.0]
unseen = ["bmw-320i"]
noises = [0.1]
pairs = [2, 4]
budgets = [30.0, 20.0]
"""


@dataclass(frozen=True)
class Result:
    code: int
    out: str
    err: str

    @property
    def name(self) -> str:
        return self.out.strip()


@pytest.fixture(scope="session", autouse=True)
def signals() -> Iterator[None]:
    """Signals as a terminal's shell hands them on, whatever this run was begun to ignore; child processes too."""
    usual = {signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL}
    before = {signum: signal.signal(signum, handler) for signum, handler in usual.items()}
    yield
    for signum, handler in before.items():
        signal.signal(signum, handler)


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    """An empty working folder with an experiment `tiny.toml` beside it."""
    (tmp_path / "tiny.toml").write_text(TINY)
    work = tmp_path / "work"
    work.mkdir()
    monkeypatch.chdir(work)
    monkeypatch.delenv("KOOP_STORE", raising=False)
    return work


@pytest.fixture
def koop(folder, capsys):
    """Run the command line here; `tiny=True` uses the tiny experiment."""

    def run(*args: str, tiny: bool = True) -> Result:
        making = args and args[0] in {*STAGES, "sweep", "reproduce"} - OF_LOGS
        extra = ["--experiment", "../tiny.toml"] if tiny and making else []
        capsys.readouterr()
        code = main([*args, *extra])
        captured = capsys.readouterr()
        return Result(code, captured.out, captured.err)

    return run


@pytest.fixture(scope="session")
def stocks(tmp_path_factory) -> Path:
    """The folder of the stores that the tests of this run share, in whichever process they run."""
    mine = tmp_path_factory.getbasetemp()
    root = (mine.parent if "PYTEST_XDIST_WORKER" in os.environ else mine) / "stocks"
    root.mkdir(exist_ok=True)
    return root


REPRODUCED = (TINY, "reproduced", [["reproduce", "--json"]])


@pytest.fixture(scope="session")
def reproduced(stocks) -> Path:
    """A store with all that `koop reproduce` makes of the tiny experiment."""
    return stock.obtain(stocks, *REPRODUCED)


@pytest.fixture(scope="session", autouse=True)
def ahead(request, stocks) -> None:
    """Of several processes that run tests the first begins that store at once, so that none waits for it later."""
    needed = any("reproduced" in item.fixturenames for item in request.session.items)
    if needed and os.environ.get("PYTEST_XDIST_WORKER") == "gw0":
        threading.Thread(target=stock.obtain, args=(stocks, *REPRODUCED), daemon=True).start()


@pytest.fixture
def stocked(folder, reproduced) -> None:
    """The test's store begins with all that `koop reproduce` makes."""
    stock.link(reproduced, folder / "artefacts")


@pytest.fixture
def undrawn(folder, reproduced) -> None:
    """The test's store begins with all that `koop reproduce` makes, but for figures."""
    stock.link(reproduced, folder / "artefacts", without=["plot"])


@pytest.fixture
def store(tmp_path) -> Store:
    return Store(tmp_path / "store")


@pytest.fixture(scope="session")
def vehicle() -> VehicleParameters:
    return read_vehicle(locate("vehicles", "ctu-2020", "vehicle"))


@pytest.fixture(scope="session")
def plant(vehicle) -> ForceInput:
    return ForceInput(vehicle)


@pytest.fixture(scope="session")
def lopsided(vehicle) -> ForceInput:
    """A vehicle whose axles differ, with more drag."""
    return ForceInput(change(vehicle, {"l_f": 1.1, "l_r": 1.6, "c_w": 0.4}, COMMAND_LINE))


@pytest.fixture(scope="session", params=["ctu-2020", "rimac-2018"])
def slips(request) -> SlipInput:
    """The plant on tyres, of both shipped vehicles."""
    return SlipInput(read_vehicle(locate("vehicles", request.param, "vehicle")))


@pytest.fixture(scope="session")
def sliding(vehicle) -> SlipInput:
    """The plant on tyres of the default vehicle."""
    return SlipInput(vehicle)


def surface_of(plant: Plant, count: int = 25, mesh: str = "sphere") -> Sample:
    """Γ at 500 kJ."""
    p = plant.parameters
    states = sampling.MESHES[mesh](count) * sampling.semi_axes(5e5, p.m, p.Jzz)
    return Sample((), states, np.zeros((count, 1, len(plant.inputs))), False, plant.states, plant.inputs)


def ball_of(plant: Plant, count: int = 2000, seed: int = 0) -> Sample:
    """States inside Γ."""
    p = plant.parameters
    states = sampling.ball(seed, count) * sampling.semi_axes(5e5, p.m, p.Jzz)
    return Sample((), states, np.zeros((count, 1, len(plant.inputs))), False, plant.states, plant.inputs)


def trajectories_of(plant: Plant, sample: Sample, steps: int, dt: float = 0.01) -> Trajectories:
    x0, u = sample.expand(steps)
    x = simulate(plant.rhs, x0, u, dt, fastest_rate=plant.fastest_rate)
    return Trajectories(x, u, dt, plant.states, plant.inputs, sample.product)


TOLD = {
    "kind": "eigenvalues",
    "low": "lowest",
    "high": "highest",
    "tabulated": "tabulate",
    "frame": "coordinates",
    "power": "radial_power",
}  # short names of settings in tests


def eigen_fit(data: Trajectories, images: int = 1, **given) -> Predictor:
    """The eigenfunction predictor of ``data`` with the paper's reading but for what is ``given``."""
    steps = {"tabulated": 100, **given}
    given = {TOLD.get(name, name): value for name, value in given.items() if value is not None}
    given |= {TOLD.get(n, n): steps[n] * data.dt for n in ("tabulated", "horizon") if steps.get(n) is not None}
    if given.get("window") != "horizon" and given.get("boundary") != "optimal":
        given.setdefault("cut", float(np.finfo(float).eps * (data.steps + 1)))
    return eigenfunctions.fit(data, eigenfunctions.FitEigen.of(**given), images)


def grid_sample(count: int = 15, draw: str = "random", seed: int = 0, columns: int = 15) -> Sample:
    factors, u = sampling.grid(seed, (30.0, 30.0, 10.0), count, draw, (1.0, 5.0, 10.0, 100.0), columns, 4)
    return Sample(factors, np.empty((0, 3)), u, True, ForceInput.states, ForceInput.inputs)


def box_sample(count: int = 3375, excitation: str = "fresh", steps: int = 30) -> Sample:
    x0, u = sampling.box(7, (30.0, 30.0, 10.0), count, excitation, 1e4, steps, 4)
    return Sample((), x0, u, False, ForceInput.states, ForceInput.inputs)


def read_all(root: Path) -> int:
    """Read and verify every artefact of a store; returns how many there are."""
    from koopcli.stages.registry import STAGES

    shelf = Store(root)
    for stage, key in shelf.index():
        record = shelf.record(stage, key)
        assert record is not None, f"damaged record {stage}/{key}"
        STAGES[stage].unpack(shelf.read(record))
    return len(shelf.index())
