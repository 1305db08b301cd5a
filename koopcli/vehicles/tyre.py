"""The tyre: forces from slips by the magic formula (docs/equations.md 6)."""

from __future__ import annotations

import numpy as np

from koopcli.records import FloatArray
from koopcli.vehicles.parameters import MagicFormula


def force(tyre: MagicFormula, slip: FloatArray, load: float | FloatArray) -> FloatArray:
    """Force in N at ``slip`` (rad for a slip angle, 1 for a slip ratio) under ``load`` in N (6.1); odd in the slip."""
    Bx = tyre.B * slip
    curved = Bx - tyre.E * (Bx - np.arctan(Bx))
    return np.asarray(tyre.mu * load * np.sin(tyre.C * np.arctan(curved)))


def stiffness(tyre: MagicFormula, load: FloatArray) -> FloatArray:
    """Slope of the force at zero slip, B C D in N per unit of slip, under ``load`` in N."""
    return tyre.B * tyre.C * tyre.mu * load


def slip_angle(v_x: FloatArray, v_y: FloatArray, v_eps: float) -> FloatArray:
    """Slip angle in rad (6.2) from the wheel's own velocity in m/s, within ±π/2 in either direction of travel.

    A wheel slower than ``v_eps`` along itself counts as that fast, so the angle is continuous at standstill.
    """
    angle: FloatArray = -np.arctan2(v_y, np.maximum(np.abs(v_x), v_eps))
    return angle
