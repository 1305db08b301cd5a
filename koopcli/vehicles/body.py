"""The rigid body in the plane, on two axles. ISO 8855 signs: x forward, y left, yaw rate positive to the left."""

from __future__ import annotations

import numpy as np

from koopcli.records import Channels, FloatArray
from koopcli.vehicles.parameters import VehicleParameters

STATES = Channels(("v_x", "v_y", "yaw_rate"), ("m/s", "m/s", "rad/s"))


def kinetic_energy(p: VehicleParameters, x: FloatArray) -> FloatArray:
    """Kinetic energy in J of the body with the states ``x`` (..., 3 or more)."""
    energy: FloatArray = 0.5 * (p.m * (x[..., 0] ** 2 + x[..., 1] ** 2) + p.Jzz * x[..., 2] ** 2)
    return energy


def derivative(p: VehicleParameters, x: FloatArray, F_x: FloatArray, F_y: FloatArray, out: FloatArray) -> FloatArray:
    """Time derivative of v_x, v_y and yaw rate in ``x`` (..., 3 or more), written into ``out`` and returned.

    ``F_x``: the sum of longitudinal forces (...,); ``F_y``: the lateral force of the front and of the rear axle
    (..., 2), all body-fixed and in N, (1.1) to (1.3).
    """
    v_x, v_y, yaw_rate = x[..., 0], x[..., 1], x[..., 2]
    front, rear = F_y[..., 0], F_y[..., 1]
    drag = 0.5 * p.c_w * p.rho * p.A * np.sqrt(v_x**2 + v_y**2)
    out[..., 0] = (F_x - drag * v_x) / p.m + yaw_rate * v_y
    out[..., 1] = (front + rear - drag * v_y) / p.m - yaw_rate * v_x
    out[..., 2] = (p.l_f * front - p.l_r * rear) / p.Jzz
    return out


def like(x: FloatArray, u: FloatArray) -> FloatArray:
    """An array for the derivative of ``x`` under ``u``."""
    rows = x.shape[:-1]
    if u.shape[:-1] != rows:
        rows = np.broadcast_shapes(rows, u.shape[:-1])
    return np.empty((*rows, x.shape[-1]))
