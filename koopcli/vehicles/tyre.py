"""The tyre: forces from slips by the magic formula (docs/equations.md 6)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from koopcli.records import FloatArray
from koopcli.vehicles.parameters import MagicFormula


class Coefficients(NamedTuple):
    """The coefficients of :class:`MagicFormula` as arrays, one entry for each of several tyres."""

    B: FloatArray
    C: FloatArray
    mu: FloatArray
    E: FloatArray
    S_h: FloatArray


def stacked(*tyres: MagicFormula) -> Coefficients:
    """The coefficients of several tyres, (n,) each."""
    return Coefficients(*(np.array([getattr(tyre, name) for tyre in tyres]) for name in Coefficients._fields))


def force(tyre: MagicFormula | Coefficients, slip: FloatArray, load: float | FloatArray) -> FloatArray:
    """Force in N at ``slip`` (rad for a slip angle, 1 for a slip ratio) under ``load`` in N (6.1).

    Without a shift it is odd in the slip; the tyre is the one of a left wheel.
    """
    Bx = tyre.B * (slip + tyre.S_h)
    curved = Bx - tyre.E * (Bx - np.arctan(Bx))
    return np.asarray(tyre.mu * load * np.sin(tyre.C * np.arctan(curved)))


def stiffness(tyre: MagicFormula | Coefficients, load: FloatArray) -> FloatArray:
    """Largest slope of the force, B C D in N per unit of slip, under ``load`` in N; that at zero slip without shift."""
    return tyre.B * tyre.C * tyre.mu * load


def slip_angle(v_x: FloatArray, v_y: FloatArray, v_eps: float) -> FloatArray:
    """Slip angle in rad (6.2) from the wheel's own velocity in m/s, within ±π/2 in either direction of travel.

    A wheel slower than ``v_eps`` along itself counts as that fast, so the angle is continuous at standstill.
    """
    angle: FloatArray = -np.arctan2(v_y, np.maximum(np.abs(v_x), v_eps))
    return angle


def slip_ratio(rolling: FloatArray, v_x: FloatArray, v_eps: float) -> FloatArray:
    """Slip ratio (6.7) of a wheel whose rim moves at ``rolling`` and whose centre at ``v_x`` along it, in m/s."""
    ratio: FloatArray = (rolling - v_x) / np.maximum(np.maximum(np.abs(rolling), np.abs(v_x)), v_eps)
    return ratio


def ellipse(
    F_x: FloatArray, F_y: FloatArray, slip_ratio: FloatArray, slip_angle: FloatArray, D_x: FloatArray, D_y: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """What of the pure forces ``F_x`` and ``F_y``, with peaks ``D_x`` and ``D_y``, a wheel gives at once, in N (6.8).

    Without slip along the wheel it is all of ``F_y``, without slip angle all of ``F_x``, and nothing without both.
    """
    across = np.sin(slip_angle)
    total = np.hypot(slip_ratio, across)
    c, s = _ratio(np.abs(slip_ratio), total), _ratio(np.abs(across), total)
    return (
        F_x * _ratio(D_y * c, np.hypot(D_y * c, F_x * s)),
        F_y * _ratio(D_x * s, np.hypot(D_x * s, F_y * c)),
    )


def _ratio(part: FloatArray, whole: FloatArray) -> FloatArray:
    """part / whole, zero where both are."""
    return np.divide(part, whole, out=np.zeros_like(whole), where=whole != 0)
