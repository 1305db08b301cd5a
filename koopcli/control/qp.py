"""Quadratic programmes by daqp, with a check that does not trust it."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.records import FloatArray

SOLVED = 1  # the flag of an optimum
NOT_FINITE = -100  # a flag of our own: the programme holds what is not a number
TOLERANCE = 1e-6  # of the KKT residual
BARE = "this controller solves a quadratic programme a step and needs daqp: pip install 'koopcli[control]'"


@dataclass(frozen=True, eq=False)
class Solution:
    """``point`` (n,) of the solver, whether it is ``accepted``, its ``kkt`` residual, the solver's ``flag``."""

    point: FloatArray
    accepted: bool
    kkt: float
    flag: int


def daqp() -> Any:
    """The solver's module. Raises ``InvalidValueError``, which says how to install it, where it is missing."""
    try:
        return import_module("daqp")
    except ImportError:
        raise InvalidValueError(BARE) from None


def solve(
    H: FloatArray, f: FloatArray, rows: FloatArray, upper: FloatArray, lower: FloatArray | None = None
) -> Solution:
    """Minimise ½ vᵀ H v + fᵀ v under ``lower`` ≤ [v_1 .. v_b, ``rows`` v] ≤ ``upper``, from nothing known before.

    ``H`` (n, n), ``f`` (n,), ``rows`` (m, n) of which none may be zero, ``upper`` and ``lower`` (b + m,): the first b
    bound variables. The solution is accepted if the solver says so and :func:`kkt_residual` is at most 1e-6;
    one with values that are not finite is not.
    Raises ``InvalidValueError`` where daqp is not installed.
    """
    solver = daqp()
    if not (np.isfinite(H).all() and np.isfinite(f).all() and np.isfinite(upper).all()):
        return Solution(np.zeros(len(f)), False, np.inf, NOT_FINITE)
    bounds = (upper,) if lower is None else (upper, lower)
    point, _, flag, info = solver.solve(H, f, rows, *bounds)
    if flag != SOLVED:
        return Solution(point, False, np.inf, int(flag))
    kkt = kkt_residual(H, f, rows, upper, lower, point, np.asarray(info["lam"]))
    return Solution(point, bool(kkt <= TOLERANCE), kkt, int(flag))


def kkt_residual(
    H: FloatArray,
    f: FloatArray,
    rows: FloatArray,
    upper: FloatArray,
    lower: FloatArray | None,
    point: FloatArray,
    multipliers: FloatArray,
) -> float:
    """The largest residual of the KKT conditions, divided by max(1, ‖f‖∞), shapes as in :func:`solve`.

    The gradient of the Lagrangian is zero, the point keeps to its bounds, and a multiplier is positive only at an
    upper bound and negative only at a lower one: where there is none, a negative one is a residual itself. A residual
    that is not a number is infinite.
    """
    simple = len(upper) - len(rows)
    value = rows @ point
    gradient = H @ point + f + rows.T @ multipliers[simple:]
    if simple:
        value = np.concatenate([point[:simple], value])
        gradient[:simple] += multipliers[:simple]
    above = value - upper
    up, down = np.maximum(multipliers, 0.0), np.maximum(-multipliers, 0.0)
    residuals = [np.abs(gradient), above, np.abs(up * above)]
    if lower is None:
        residuals += [down]
    else:
        below = lower - value
        residuals += [below, np.abs(down * below)]
    residual = float(np.concatenate(residuals).max() / max(1.0, np.abs(f).max()))
    return residual if np.isfinite(residual) else np.inf
