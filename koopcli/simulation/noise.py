"""Noise on what is measured of simulated trajectories."""

from __future__ import annotations

import math

import numpy as np

from koopcli.records import Channels, FloatArray

SHARE = {"m/s": 1.0, "rad/s": 0.1}  # of the deviation that is given for velocities, by the unit of a state
HALF = 2.0**-54  # half a step between draws, so that none is zero


def deviations(sigma: float, states: Channels) -> FloatArray:
    """The standard deviation of the noise of each of the ``states``, (n_x,): ``sigma`` of velocities in m/s, a tenth
    of it in rad/s.
    """
    return sigma * np.array([SHARE[unit] for unit in states.units])


def measured(x: FloatArray, first: int, deviation: FloatArray, seed: int, memory: float = 0.0) -> FloatArray:
    """The trajectories ``x`` (n, samples, n_x), from number ``first`` on, with normal noise of a ``deviation`` (n_x,)
    on every sample, of which a share ``memory`` stays in the next one.

    A draw depends on its ``seed``, trajectory, sample and state alone, however many are drawn together: the generator
    gives one uniform number for each, and is moved on to the first.
    """
    from scipy.special import ndtri  # noqa: PLC0415  (what measures without noise goes without)

    source = np.random.PCG64(seed).advance(first * x[0].size)
    noise = np.asarray(ndtri(np.random.Generator(source).random(x.shape) + HALF))
    if memory:
        noise[:, 1:] *= math.sqrt(1.0 - memory**2)
        for k in range(1, x.shape[1]):
            noise[:, k] += memory * noise[:, k - 1]
    return np.asarray(x + deviation * noise)
