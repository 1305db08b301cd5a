"""A car at its limits, and small predictors of it."""

from __future__ import annotations

from importlib.util import find_spec

import pytest

from koopcli.config.data import locate
from koopcli.control.limits import Limits
from koopcli.control.tyres import Tyres
from koopcli.koopman.bases.polynomial import Anisotropic
from koopcli.koopman.edmd import fit as edmd
from koopcli.koopman.predictor.predictor import Predictor
from koopcli.vehicles.parameters import VehicleParameters, read_vehicle
from koopcli.vehicles.plants.forces import ForceInput
from koopcli.vehicles.plants.slips import SlipInput
from tests.conftest import ball_of, eigen_fit, grid_sample, trajectories_of

solver = pytest.mark.skipif(find_spec("daqp") is None, reason="daqp is not installed")


@pytest.fixture(scope="session")
def rimac() -> VehicleParameters:
    """The vehicle of the reference figures: grip of about one."""
    return read_vehicle(locate("vehicles", "rimac-2018", "vehicle"))


@pytest.fixture(scope="session")
def tyres(rimac) -> Tyres:
    return Tyres(rimac)


@pytest.fixture(scope="session")
def limits() -> Limits:
    return Limits()


@pytest.fixture(scope="session")
def generator(rimac) -> Predictor:
    """27 functions, as F has them."""
    data = trajectories_of(ForceInput(rimac), grid_sample(columns=15), 1)
    choice = Anisotropic(order=8)
    return edmd.fit(data, choice.make(data.x[:, 0]), edmd.FitEdmd.of(terms="generator"))


@pytest.fixture(scope="session")
def eigen(rimac) -> Predictor:
    """Eigenfunctions of half a second from few trajectories."""
    data = trajectories_of(SlipInput(rimac), ball_of(SlipInput(rimac), 150, seed=4), 100)
    given = {"window": "horizon", "kind": "comb", "pairs": 10, "cut": 1e-10, "lift": "polyharmonic"}
    return eigen_fit(data, **given, frame="world", horizon=50, tabulated=50, power=0.5, spacing=4)
