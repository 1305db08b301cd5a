"""Numbers that follow from a vehicle's parameters alone: loads, stiffnesses, steady cornering (docs/equations.md 9)."""

from __future__ import annotations

import math

from koopcli.vehicles.parameters import REAR, MagicFormula, VehicleParameters

G = 9.81  # m/s²
NEUTRAL = 1e-12  # rad s²/m: an understeer gradient as small as this is rounding


def wheel_loads(p: VehicleParameters) -> tuple[float, float]:
    """Static load of one wheel of the front and of the rear axle in N."""
    L = p.l_f + p.l_r
    return p.l_r * p.m * G / (2 * L), p.l_f * p.m * G / (2 * L)


def tyres_of(p: VehicleParameters, direction: str) -> tuple[MagicFormula, MagicFormula]:
    """The tyres of the front and of the rear axle, ``lateral`` or ``longitudinal``, of a vehicle that has them."""
    front: MagicFormula | None = getattr(p, direction)
    rear: MagicFormula | None = getattr(p, REAR[direction])
    assert front is not None, "checked when the plant was made"
    return front, rear or front


def cornering_stiffness(p: VehicleParameters) -> tuple[float, float]:
    """Slope of the lateral force of the front and of the rear axle at straight running in N/rad, (9.1)."""
    load, tyre = wheel_loads(p), tyres_of(p, "lateral")
    return _of_axle(p, tyre[0], load[0]), _of_axle(p, tyre[1], load[1])


def understeer_gradient(p: VehicleParameters) -> float:
    """How much more steer a steady turn takes for each m/s² of lateral acceleration, in rad s²/m, (9.2).

    Positive: the car understeers; zero, and exactly so where both axles have one tyre: neutral; without grip there is
    none.
    """
    front, rear = cornering_stiffness(p)
    if front == 0 or rear == 0:
        return math.nan
    gradient = p.m / (p.l_f + p.l_r) * (p.l_r / front - p.l_f / rear)
    return gradient if abs(gradient) > NEUTRAL else 0.0


def critical_speed(p: VehicleParameters) -> float:
    """Speed in m/s beyond which straight running is unstable, (9.3); infinite unless the car oversteers."""
    gradient = understeer_gradient(p)
    return math.sqrt((p.l_f + p.l_r) / -gradient) if gradient < 0 else math.inf


def steady_steer(p: VehicleParameters, speed: float, lateral: float) -> float:
    """Steer in rad of the linear single-track car in a steady turn at ``lateral`` m/s² and ``speed`` m/s, (9.2)."""
    return (p.l_f + p.l_r) * lateral / speed**2 + understeer_gradient(p) * lateral


def wheel_poles(p: VehicleParameters, speed: float, v_eps: float) -> tuple[float, float]:
    """Rate in 1/s at which a front and a rear wheel come to roll at ``speed`` m/s, (6.10), where both are known."""
    assert p.r_w is not None, "checked before"
    assert p.J_R is not None, "checked before"
    fast = p.r_w**2 / (p.J_R * max(abs(speed), v_eps)) * p.mu_scale
    front, rear = (
        fast * tyre.B * tyre.C * tyre.mu * load
        for tyre, load in zip(tyres_of(p, "longitudinal"), wheel_loads(p), strict=True)
    )
    return front, rear


def _of_axle(p: VehicleParameters, tyre: MagicFormula, load: float) -> float:
    """Half the sum of the slopes of a left and a right wheel at zero slip is the slope of either."""
    shifted = tyre.B * tyre.S_h
    curved = shifted - tyre.E * (shifted - math.atan(shifted))
    inner = tyre.B * (1 - tyre.E * (1 - 1 / (1 + shifted**2)))
    slope = tyre.mu * load * math.cos(tyre.C * math.atan(curved)) * tyre.C * inner / (1 + curved**2)
    return 2 * p.mu_scale * slope
