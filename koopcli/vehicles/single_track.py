"""Single-track equations of motion. ISO 8855 signs: x forward, y left, yaw rate positive to the left."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from koopcli.records import Channels, FloatArray
from koopcli.vehicles.parameters import VehicleParameters


@dataclass(frozen=True)
class ForceInput:
    """Three states, tyre forces as inputs, air drag (docs/equations.md 1).

    State ``x = [v_x, v_y, yaw_rate]`` in m/s, m/s, rad/s; input ``u = [F_fx, F_fy, F_rx, F_ry]`` in N, the body-fixed
    forces of an axle (``wheels_per_force = 1``) or of each of its two wheels (``wheels_per_force = 2``).
    """

    parameters: VehicleParameters
    wheels_per_force: int = 1

    states = Channels(("v_x", "v_y", "yaw_rate"), ("m/s", "m/s", "rad/s"))
    inputs = Channels(("F_fx", "F_fy", "F_rx", "F_ry"), ("N", "N", "N", "N"))

    def rhs(self, x: FloatArray, u: FloatArray) -> FloatArray:
        """Time derivative of ``x`` (..., 3) under ``u`` (..., 4), eqs. (1.1) to (1.3)."""
        p, n = self.parameters, self.wheels_per_force
        v_x, v_y, yaw_rate = x[..., 0], x[..., 1], x[..., 2]
        F_fx, F_fy, F_rx, F_ry = u[..., 0], u[..., 1], u[..., 2], u[..., 3]
        drag = 0.5 * p.c_w * p.rho * p.A * np.sqrt(v_x**2 + v_y**2)
        dx = np.empty((*np.broadcast_shapes(x.shape[:-1], u.shape[:-1]), 3))
        dx[..., 0] = (n * (F_fx + F_rx) - drag * v_x) / p.m + yaw_rate * v_y
        dx[..., 1] = (n * (F_fy + F_ry) - drag * v_y) / p.m - yaw_rate * v_x
        dx[..., 2] = n * (p.l_f * F_fy - p.l_r * F_ry) / p.Jzz
        return dx

    def kinetic_energy(self, x: FloatArray) -> FloatArray:
        """Kinetic energy in J of the states ``x`` (..., 3)."""
        p = self.parameters
        energy: FloatArray = 0.5 * (p.m * (x[..., 0] ** 2 + x[..., 1] ** 2) + p.Jzz * x[..., 2] ** 2)
        return energy
