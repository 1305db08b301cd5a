from __future__ import annotations

import numpy as np
import pytest

from koopcli.koopman.predictor import responses
from koopcli.koopman.predictor.modes import Modes


class Linear:
    """ψ(x) = M x, and how often it was asked."""

    def __init__(self, M):
        self.M, self.asked = M, 0

    def lift(self, x):
        self.asked += 1
        return x @ self.M.T

    def observe(self, x, rows):
        return self.lift(x) @ rows.T


@pytest.fixture(params=["a matrix", "rates"])
def system(request):
    """Lift, A, B and C of six lifted states, two measured states and an input."""
    rng = np.random.default_rng(8)
    if request.param == "rates":
        A = Modes(np.array([-0.5 + 2j, -0.5 - 2j, 0.1]), np.array([0.0, 0.7]), 2, 0.1)
    else:
        A = rng.standard_normal((6, 6))
        A *= 1.01 / np.abs(np.linalg.eigvals(A)).max()  # it grows a little
    return Linear(rng.standard_normal((6, 2))), A, rng.standard_normal((6, 1)), rng.standard_normal((2, 6))


@pytest.mark.parametrize("steps", [0, 5, 6, 7, 12, 13, 100])
def test_stretches_follow_from_one_another(system, steps, monkeypatch):
    """On either side of one stretch of six steps and of two."""
    monkeypatch.setattr(responses, "SEGMENT", 4)
    lift, A, B, C = system
    rng = np.random.default_rng(9)
    x0, u = rng.standard_normal((5, 2)), rng.standard_normal((5, steps, 1))
    z = lift.lift(x0)
    rolled = [z @ C.T]
    for k in range(steps):
        z = (A @ z.T).T + u[:, k] @ B.T
        rolled.append(z @ C.T)
    assert responses.linear(*system, x0, u) == pytest.approx(np.stack(rolled, axis=1), rel=1e-10, abs=1e-10)


def test_what_is_formed_does_not_grow_with_the_steps(system, monkeypatch):
    """Else time would grow as their square; a lift from data costs as many steps as it holds, each time."""
    formed = []
    real = responses._toeplitz
    monkeypatch.setattr(responses, "_toeplitz", lambda *args: formed.append(real(*args)) or formed[-1])

    def asked_and_formed(steps):
        formed.clear()
        lift = Linear(system[0].M)
        responses.linear(lift, *system[1:], np.ones((1, 2)), np.ones((1, steps, 1)))
        return lift.asked, sum(block.size for block in formed)

    assert asked_and_formed(4000) == asked_and_formed(1000)
