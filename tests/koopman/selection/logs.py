"""Made-up logs: their mathematics is known, so what must come of them is too."""

from __future__ import annotations

import numpy as np

from koopcli.records import Channels, Episodes, FloatArray


def smooth_inputs(rows: int, count: int, seed: int, keep: float = 0.9) -> FloatArray:
    """Inputs (rows, count) that wander: a low-passed noise of spread one."""
    noise = np.random.default_rng(seed).normal(size=(rows, count))
    values = np.zeros((rows, count))
    for k in range(1, rows):
        values[k] = keep * values[k - 1] + np.sqrt(1 - keep**2) * noise[k]
    return values


def log(
    x: FloatArray,
    u: FloatArray,
    lengths: list[int] | None = None,
    runs: list[int] | None = None,
    dt: float = 0.05,
    states: tuple[str, ...] = (),
    inputs: tuple[str, ...] = (),
) -> Episodes:
    """A log of x and u, one episode unless ``lengths`` says otherwise; channels without a name are numbered."""
    lengths = lengths or [len(x)]
    bounds = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)
    states = states or tuple(f"x{i}" for i in range(x.shape[1]))
    inputs = inputs or tuple(f"u{i}" for i in range(u.shape[1]))
    return Episodes(
        x=x,
        u=u,
        dt=dt,
        bounds=bounds,
        starts=100.0 * np.arange(len(lengths)),
        runs=np.array(runs or [0] * len(lengths), dtype=np.int64),
        state_channels=Channels(states, ("m/s",) * len(states)),
        input_channels=Channels(inputs, ("rad",) * len(inputs)),
    )


def delayed(rows: int = 2400, seed: int = 1) -> tuple[FloatArray, FloatArray]:
    """A linear system of two states, whose inputs act after three steps and whose first state remembers two."""
    u = smooth_inputs(rows, 2, seed)
    x = np.zeros((rows, 2))
    for k in range(3, rows - 1):
        x[k + 1, 0] = 1.2 * x[k, 0] - 0.3 * x[k - 2, 0] + 0.1 * u[k - 3, 0]
        x[k + 1, 1] = 0.95 * x[k, 1] + 0.04 * x[k, 0] + 0.2 * u[k - 3, 1]
    return x, u


def bilinear(rows: int = 2400, seed: int = 2) -> tuple[FloatArray, FloatArray]:
    """A system of two states that an input turns: its effect is its product with the state."""
    u = smooth_inputs(rows, 2, seed)
    x = np.zeros((rows, 2))
    x[0] = [1.0, 0.5]
    for k in range(rows - 1):
        pull = np.array([1.0, 0.0]) - x[k]
        turn = u[k, 0] * np.array([-x[k, 1], x[k, 0]])
        x[k + 1] = x[k] + 0.05 * pull + 0.1 * turn + 0.02 * u[k, 1]
    return x, u
