"""Whether what a log says of turning is that of a car: speed, yaw rate, steer, side speed and lateral acceleration."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from koopcli.logs.check import Check, Verdict
from koopcli.logs.hints import DEGREES, KMH, RATE, SPEED, USUAL_WHEELBASE, factor_hint, slope_hint, unit_hint
from koopcli.logs.measures import (
    FEWEST,
    TOLD,
    Measured,
    above,
    below,
    best_lag,
    correlation_of,
    fit,
    most,
    side_fit,
    slope_of,
    spread,
    varies,
)

LATERAL = (17.0, 60.0)  # m/s²: warn, ask
WHEELBASES = (0.1, 70.0)  # m, steering-wheel angles included
NEAR, FAR = (0.67, 1.5), (0.4, 2.5)  # wheelbase from the log over that of the map: note, ask
STRAIGHT = 1.0  # m/s² of lateral acceleration: a road with hardly a curve
DOUBTED = 2.0  # times as far may a wheelbase be that the log hardly tells
CORRELATIONS = (0.5, 0.0)  # warn, ask
SPREAD = 0.1  # of the speed: below it L and K, and a and b, cannot be told apart
CHARACTERISTIC = 20.0  # m/s, at which an understeering car needs twice the steer: K = 1 / 20²
LONGEST_LAG, USUAL_LAG = 0.75, 0.1  # s
SLOPES = (0.7, 1.4)  # of v r over a_y


def turning_checks(log: Measured) -> Iterator[Check]:
    """The checks that the signals allow."""
    for make in (_lateral, _wheelbase, _steer_and_yaw, _side_speed, _acceleration):
        yield from make(log)


def _lateral(log: Measured) -> Iterator[Check]:
    if signals := log.get("v_x", "yaw_rate"):
        value = most(signals[0] * signals[1])
        verdict = above(value, *LATERAL)
        other = "is one of v_x and yaw_rate another signal, or does it jump?"
        units = ((SPEED, KMH), (RATE, DEGREES)) if verdict == "warn" else ((RATE, DEGREES),)
        hint = "" if verdict == "ok" else unit_hint(log.said, *units, otherwise=other)
        yield Check("lateral_acceleration", value, "m/s²", f"at most {LATERAL[0]:g}", verdict, hint)


def _wheelbase(log: Measured) -> Iterator[Check]:
    """L of steer = c + L r/v + K r v above a quarter of the top speed; K = 0 where the two cannot be told apart."""
    signals = log.get("v_x", "yaw_rate", "steer")
    if signals is None:
        return
    v, r, steer = signals
    agrees = correlation_of(v * steer, r) > 0
    fast = np.abs(v) > most(v) / 4
    v, r, steer = v[fast], r[fast], steer[fast]
    if len(v) < FEWEST or not (varies(r) and varies(steer)):
        return
    columns = np.column_stack([np.ones_like(v), r / v, r * v])
    alone = spread(v, r) < SPREAD or (agrees and fit(columns, steer)[1] <= 0)
    columns = columns[:, :2] if alone else columns
    weights = fit(columns, steer)
    value = float(weights[1])
    if agrees and value <= 0:  # what it is, this log does not tell
        return
    grown = 1 + float(np.average(v**2, weights=r**2)) / CHARACTERISTIC**2 if alone else 1.0
    hardly = most(r * v) < STRAIGHT or correlation_of(columns @ weights, steer) < TOLD
    doubted = DOUBTED if hardly else 1.0
    yield _judged(log, value, FAR[0] / doubted, FAR[1] * doubted * grown, most(r * v))


def _judged(log: Measured, value: float, least: float, longest: float, lateral: float) -> Check:
    """The check of a wheelbase in m, which may be ``least`` to ``longest`` times that of the map.

    ``lateral``: the most lateral acceleration in m/s², for the hint.
    """
    if log.wheelbase is None:
        inside = WHEELBASES[0] <= value <= WHEELBASES[1]
        hint = "" if inside else factor_hint(value / USUAL_WHEELBASE, log.said, lateral)
        return Check("wheelbase", value, "m", "0.1 to 70", "ok" if inside else "ask", hint)
    ratio = value / log.wheelbase
    near, far = NEAR[0] <= ratio <= NEAR[1], least <= ratio <= longest
    verdict: Verdict = "ok" if near else "note" if far else "ask"
    low, high = (factor * log.wheelbase for factor in NEAR)
    hint = factor_hint(ratio, log.said, lateral) if verdict == "ask" else ""
    if verdict == "note":
        hint = (
            f"{ratio:.2g} × the wheelbase of the map: much sliding, hardly a curve, one speed alone, or a ratio of the "
            "steering that is not quite so"
        )
    return Check("wheelbase", value, "m", f"{low:.3g} to {high:.3g}, the map says {log.wheelbase:g}", verdict, hint)


def _steer_and_yaw(log: Measured) -> Iterator[Check]:
    """How v · steer and the yaw rate go together, and which of them comes first."""
    signals = log.get("v_x", "yaw_rate", "steer")
    if signals is None:
        return
    v, r, steer = signals
    turning = v * steer
    if not (varies(turning) and varies(r)):
        return
    value = correlation_of(turning, r)
    verdict = below(value, *CORRELATIONS)
    hint = {
        "ask": _sign_hint(log),
        "warn": "is one of v_x, yaw_rate and steer another signal, or are their clocks apart?",
    }
    yield Check("steer_yaw_correlation", value, "1", "0.66 to 1, at least 0.5", verdict, hint.get(verdict, ""))
    lag, together = best_lag(log, turning, r, LONGEST_LAG)
    if together < TOLD:
        return
    late = lag < 0
    mending = (
        f"yaw_rate turns {-lag:.2g} s before steer does: offset = {lag - USUAL_LAG:.2g} (s) for the source of steer, "
        f"or {USUAL_LAG - lag:.2g} for that of yaw_rate, leaves the usual {USUAL_LAG:g} s"
    )
    yield Check("steer_yaw_lag", lag, "s", "0 to 0.4, at least 0", "warn" if late else "ok", mending if late else "")


def _sign_hint(log: Measured) -> str:
    """Which of yaw rate and steer has the wrong sign, as far as another signal tells."""
    for name in ("a_y", "v_y"):
        signals = log.get(name, "yaw_rate", "v_x")
        if signals is None:
            continue
        other, r, v = signals
        lever, correlation = side_fit(other, r, v) if name == "v_y" else (1.0, correlation_of(other, r * v))
        if abs(correlation) > TOLD:
            agrees = lever * correlation > 0
            wrong, said = ("steer", "agrees with") if agrees else ("yaw_rate", "contradicts")
            return f"sign = -1 for {wrong}: {name} {said} yaw_rate"
    return "sign = -1 for steer or for yaw_rate: both are positive to the left"


def _side_speed(log: Measured) -> Iterator[Check]:
    signals = log.get("v_y", "yaw_rate", "v_x")
    if signals is None or not (varies(signals[0]) and varies(signals[1])) or spread(signals[2], signals[1]) < SPREAD:
        return
    lever, correlation = side_fit(*signals)
    if correlation > TOLD:
        hint = "sign = -1 for v_y (or side_slip), or for yaw_rate: all are positive to the left"
        wrong = lever < 0
        yield Check(
            "side_speed", lever, "m", "0.16 to 2.2, at least 0", "warn" if wrong else "ok", hint if wrong else ""
        )


def _acceleration(log: Measured) -> Iterator[Check]:
    """How many times as large as the lateral acceleration v r is, where the two go together."""
    signals = log.get("v_x", "yaw_rate", "a_y")
    if signals is None or not (varies(signals[0] * signals[1]) and varies(signals[2])):
        return
    value = slope_of(signals[0] * signals[1], signals[2])
    fits = SLOPES[0] <= value <= SLOPES[1]
    hint = "" if fits else slope_hint(value, log.said)
    yield Check("speed_yaw_acceleration", value, "1", "0.7 to 1.4", "ok" if fits else "ask", hint)
