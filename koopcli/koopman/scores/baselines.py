"""Baselines: predictions without any fit, which a predictor has to beat (docs/equations.md 8)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from koopcli.content import Content
from koopcli.koopman.predictor.coverage import Coverage
from koopcli.progress import Progress, silent
from koopcli.records import Channels, FloatArray, Meta, Packed
from koopcli.vehicles.plants import remembered_plant

TERMS = 15  # with a norm of at most ½ the next one is 1e-17
DIFFERENCE = 1e-5  # in units of the state or input, of the central differences behind a Jacobian


@dataclass(frozen=True, eq=False, repr=False)
class Forecast(Content):
    """``hold`` keeps the first state, ``rotation`` turns the velocity at a constant yaw rate (8.1), ``linearisation``
    follows ẋ = f(x0, 0) + J (x - x0) + J_u u (8.2).

    It is scored like a predictor: ``dt`` in s, ``coverage`` of the trajectories it is compared on, ``plant`` as JSON.
    """

    kind: str
    dt: float
    coverage: Coverage
    state_channels: Channels
    input_channels: Channels
    plant: Meta

    functions = 0

    @property
    def knows_inputs(self) -> bool:
        """Whether inputs move the prediction at all."""
        return self.kind == "linearisation"

    def bound(self, x: FloatArray) -> FloatArray | None:
        """Nothing is known of its errors."""
        return None

    def predict(self, x0: FloatArray, u: FloatArray, *, progress: Progress = silent) -> FloatArray:
        """States (n, steps+1, n_x) from ``x0`` (n, n_x) under ``u`` (n, steps, n_u)."""
        return FORECASTS[self.kind](self, x0, u)

    def step(self, x: FloatArray, u: FloatArray) -> FloatArray:
        """One step from ``x`` (n, n_x) under ``u`` (n, n_u)."""
        return self.predict(x, u[:, np.newaxis])[:, 1]

    def pack(self) -> Packed:
        """The baseline for storage."""
        meta = {
            "kind": self.kind,
            "dt": self.dt,
            "plant": self.plant,
            "state_channels": self.state_channels.pack(),
            "input_channels": self.input_channels.pack(),
        }
        return Packed(self.coverage.pack(self.state_channels.unit_text).arrays, meta)

    @classmethod
    def unpack(cls, packed: Packed) -> Forecast:
        """The inverse of :meth:`pack`."""
        meta = packed.meta
        return cls(
            meta["kind"],
            meta["dt"],
            Coverage.unpack(packed),
            Channels.unpack(meta["state_channels"]),
            Channels.unpack(meta["input_channels"]),
            meta["plant"],
        )


def hold(about: Forecast, x0: FloatArray, u: FloatArray) -> FloatArray:
    """The first state, for ever."""
    return np.repeat(x0[:, np.newaxis], u.shape[1] + 1, axis=1)


def rotation(about: Forecast, x0: FloatArray, u: FloatArray) -> FloatArray:
    """The velocity kept in the world and the yaw rate kept: in body axes it turns backwards (8.1)."""
    x = hold(about, x0, u)
    turned = -x0[:, 2, np.newaxis] * about.dt * np.arange(x.shape[1])
    x[:, :, 0] = np.cos(turned) * x0[:, :1] - np.sin(turned) * x0[:, 1:2]
    x[:, :, 1] = np.sin(turned) * x0[:, :1] + np.cos(turned) * x0[:, 1:2]
    return x


def linearisation(about: Forecast, x0: FloatArray, u: FloatArray) -> FloatArray:
    """The plant linearised at each x0 without input, one exact step of dt after the other (8.2)."""
    plant = remembered_plant(about.plant)
    (n, n_x), steps, n_u = x0.shape, u.shape[1], u.shape[2]
    none = np.zeros((n, n_u))
    generator = np.zeros((n, n_x + 1 + n_u, n_x + 1 + n_u))  # of what is away from x0, of a one, and of held inputs
    generator[:, :n_x, n_x] = plant.rhs(x0, none)
    for i in range(n_x):
        difference = DIFFERENCE * np.eye(n_x)[i]
        generator[:, :n_x, i] = (plant.rhs(x0 + difference, none) - plant.rhs(x0 - difference, none)) / (2 * DIFFERENCE)
    for i in range(n_u):
        difference = none + DIFFERENCE * np.eye(n_u)[i]
        slope = (plant.rhs(x0, difference) - plant.rhs(x0, -difference)) / (2 * DIFFERENCE)
        generator[:, :n_x, n_x + 1 + i] = slope
    forward = _exponential(generator * about.dt)[:, :n_x]
    x, now = hold(about, x0, u), np.ones((n, n_x + 1 + n_u))
    now[:, :n_x] = 0.0
    for k in range(steps):
        now[:, n_x + 1 :] = u[:, k]
        now[:, :n_x] = np.matmul(forward, now[:, :, np.newaxis])[:, :, 0]
        x[:, k + 1] += now[:, :n_x]
    return x


def _exponential(M: FloatArray) -> FloatArray:
    """e^M of many small matrices (n, s, s) at once: Taylor's series of M / 2^k, squared k times.

    A loop over scipy's expm costs a second for 2 000 of them, and thirty on a busy machine.
    """
    largest = float(np.abs(M).sum(axis=2).max(initial=0.0))
    halvings = max(0, math.ceil(math.log2(max(largest, 1e-300))) + 1)
    small = M / 2.0**halvings
    term = np.broadcast_to(np.eye(M.shape[1]), M.shape)
    total = term.copy()
    for i in range(1, TERMS):
        term = term @ small / i
        total += term
    for _ in range(halvings):
        total = total @ total
    return total


FORECASTS = {"hold": hold, "rotation": rotation, "linearisation": linearisation}
