"""Whether the signals of a log fit together as those of a car do, and what would mend them.

Signals are known by their names, as states or as inputs: v_x, v_y, yaw_rate, steer (and a_z). In SI and radians.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from koopcli.logs import quantities
from koopcli.logs.check import Check, Verdict
from koopcli.logs.measures import (
    FEWEST,
    Measured,
    best_lag,
    correlation_of,
    explained,
    fit,
    most,
    rms,
    scaled,
    side_fit,
    varies,
)
from koopcli.records import Episodes

LATERAL = (17.0, 60.0)  # m/s²: warn, ask
LONGITUDINAL, LONGITUDINAL_SMALL, SMALL = 15.0, 40.0, 1.0  # m/s², of a car and of one with a wheelbase below 1 m
WHEELBASES = (0.1, 70.0)  # m, steering-wheel angles included
NEAR, FAR = (0.67, 1.5), (0.4, 2.5)  # wheelbase from the log over that of the map: note, ask
CORRELATIONS = (0.5, 0.0)  # warn, ask
SIDE_CORRELATION = 0.6
LONGEST_LAG, LATEST, USUAL_LAG = 0.75, 0.4, 0.1  # s
SPAN, DRIVEN = 0.5, 0.3  # s; R²
UNCHANGED, NOISY, NOISE_SPAN = 0.10, 0.20, 0.25  # shares; s
SLOPE_SPAN = 0.05  # s, over which dv/dt is taken on finer grids


def checks_of(episodes: Episodes, wheelbase: float | None = None) -> list[Check]:
    """The checks of ``episodes`` that their signals allow; ``wheelbase`` in m, None where it is unknown.

    A check whose signals are missing, never change or have too few rows is not made. No difference and no lag crosses
    the seam between two episodes.
    """
    log = Measured(episodes, wheelbase)
    makers = (_lateral, _wheelbase, _steer_and_yaw, _side_speed, _longitudinal, _drive, _unchanged, _noise, _magnitudes)
    with np.errstate(divide="ignore", invalid="ignore"):  # values that are not finite are not reported
        return [check for make in makers for check in make(log) if np.isfinite(check.value)]


def _lateral(log: Measured) -> Iterator[Check]:
    if signals := log.get("v_x", "yaw_rate"):
        value = most(signals[0] * signals[1])
        hint = {
            "warn": "is v_x in km/h (unit = 'km/h', factor 3.6), or yaw_rate in deg/s (unit = 'deg/s', factor 57.3)?",
            "ask": "is yaw_rate in deg/s (unit = 'deg/s', factor 57.3)?",
        }
        verdict = _above(value, *LATERAL)
        yield Check("lateral_acceleration", value, "m/s²", "0.13 to 17", verdict, hint.get(verdict, ""))


def _wheelbase(log: Measured) -> Iterator[Check]:
    """L of steer = c + L r/v + K r v above a quarter of the top speed."""
    signals = log.get("v_x", "yaw_rate", "steer")
    if signals is None:
        return
    v, r, steer = signals
    fast = np.abs(v) > most(v) / 4
    v, r, steer = v[fast], r[fast], steer[fast]
    if len(v) < FEWEST or not (varies(r) and varies(steer)):
        return
    value = float(fit(np.column_stack([np.ones_like(v), r / v, r * v]), steer)[1])
    if log.wheelbase is None:
        inside = WHEELBASES[0] <= value <= WHEELBASES[1]
        hint = "" if inside else quantities.factor_hint(value / quantities.USUAL_WHEELBASE)
        yield Check("wheelbase", value, "m", "0.1 to 70", "ok" if inside else "ask", hint)
        return
    ratio = value / log.wheelbase
    verdict: Verdict = "ok" if _within(ratio, NEAR) else "note" if _within(ratio, FAR) else "ask"
    low, high = (factor * log.wheelbase for factor in NEAR)
    hint = quantities.factor_hint(ratio) if verdict == "ask" else ""
    if verdict == "note":
        hint = f"{ratio:.2g} × the wheelbase of the map: much sliding, or a ratio of the steering that is not quite so"
    yield Check("wheelbase", value, "m", f"{low:.3g} to {high:.3g}, the map says {log.wheelbase:g}", verdict, hint)


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
    verdict = _below(value, *CORRELATIONS)
    hint = {
        "ask": _sign_hint(log),
        "warn": "is one of v_x, yaw_rate and steer another signal, or are their clocks apart?",
    }
    yield Check("steer_yaw_correlation", value, "1", "0.66 to 1", verdict, hint.get(verdict, ""))
    lag = best_lag(log, turning, r, LONGEST_LAG)
    late = lag < 0
    mending = (
        f"yaw_rate turns {-lag:.2g} s before steer does: offset = {lag - USUAL_LAG:.2g} (s) for the source of steer, "
        f"or {USUAL_LAG - lag:.2g} for that of yaw_rate, leaves the usual {USUAL_LAG:g} s"
    )
    yield Check("steer_yaw_lag", lag, "s", f"0 to {LATEST:g}", "warn" if late else "ok", mending if late else "")


def _sign_hint(log: Measured) -> str:
    """Which of yaw rate and steer has the wrong sign, as far as another signal tells."""
    for name in ("a_y", "v_y"):
        signals = log.get(name, "yaw_rate", "v_x")
        if signals is None:
            continue
        other, r, v = signals
        lever, correlation = side_fit(other, r, v) if name == "v_y" else (1.0, correlation_of(other, r * v))
        if abs(correlation) > SIDE_CORRELATION:
            agrees = lever * correlation > 0
            wrong, said = ("steer", "agrees with") if agrees else ("yaw_rate", "contradicts")
            return f"sign = -1 for {wrong}: {name} {said} yaw_rate"
    return "sign = -1 for steer or for yaw_rate: both are positive to the left"


def _side_speed(log: Measured) -> Iterator[Check]:
    signals = log.get("v_y", "yaw_rate", "v_x")
    if signals is None or not (varies(signals[0]) and varies(signals[1])):
        return
    lever, correlation = side_fit(*signals)
    if correlation > SIDE_CORRELATION:
        hint = "sign = -1 for v_y (or side_slip), or for yaw_rate: all are positive to the left"
        wrong = lever < 0
        yield Check("side_speed", lever, "m", "0.16 to 2.2", "warn" if wrong else "ok", hint if wrong else "")


def _longitudinal(log: Measured) -> Iterator[Check]:
    signals = log.get("v_x")
    steps = log.steps(SLOPE_SPAN)
    rows = log.pairs(steps)
    if signals is None or len(rows) < FEWEST:
        return
    (v,) = signals
    value = most((v[rows + steps] - v[rows]) / (steps * log.dt))
    small = log.wheelbase is not None and log.wheelbase < SMALL
    limit = LONGITUDINAL_SMALL if small else LONGITUDINAL
    unknown = (
        ", or is the car small: give its wheelbase" if log.wheelbase is None and value < LONGITUDINAL_SMALL else ""
    )
    hint = f"is v_x in km/h (unit = 'km/h', factor 3.6), or does it jump{unknown}?" if value > limit else ""
    healthy = f"{'19 to 32' if small else '2 to 11'}, at most {limit:g}"
    yield Check("longitudinal_acceleration", value, "m/s²", healthy, "warn" if value > limit else "ok", hint)


def _drive(log: Measured) -> Iterator[Check]:
    """What the mean inputs of 0.5 s add to the share of the change of v_x that the states explain."""
    signals = log.get("v_x")
    steps = log.steps(SPAN)
    rows = log.pairs(steps)
    if signals is None or "v_x" not in log.episodes.state_channels.names or len(rows) < FEWEST or not log.u.size:
        return
    (v,) = signals
    change = v[rows + steps] - v[rows]
    if not varies(change):
        return
    sums = np.vstack([np.zeros(log.u.shape[1]), np.cumsum(log.u, axis=0)])
    inputs = (sums[rows + steps] - sums[rows]) / steps
    states = np.column_stack([np.ones(len(rows)), scaled(log.x[rows])])
    value = explained(np.column_stack([states, scaled(inputs)]), change) - explained(states, change)
    weak = value < DRIVEN
    hint = "nothing drives v_x: map a pedal, a torque or a_x as an input, or make v_x itself an input" if weak else ""
    yield Check("drive", value, "1", "0.3 to 0.9", "note" if weak else "ok", hint, "v_x")


def _unchanged(log: Measured) -> Iterator[Check]:
    rows = log.pairs(1)
    if len(rows) < FEWEST:
        return
    for name, values in zip(log.episodes.state_channels.names, log.x.T, strict=True):
        value = float((values[rows + 1] == values[rows]).mean())
        often = value > UNCHANGED
        hint = "it is coarse, or slower than the grid: a longer dt" if often else ""
        yield Check("unchanged", 100 * value, "%", "below 1", "note" if often else "ok", hint, name)


def _noise(log: Measured) -> Iterator[Check]:
    """The noise of white errors, whose second difference is √6 times as large, over the change in 0.25 s."""
    steps = log.steps(NOISE_SPAN)
    near, far = log.pairs(2), log.pairs(steps)
    if min(len(near), len(far)) < FEWEST:
        return
    for name, values in zip(log.episodes.state_channels.names, log.x.T, strict=True):
        change = rms(values[far + steps] - values[far])
        if change == 0:
            continue
        value = rms(values[near + 2] - 2 * values[near + 1] + values[near]) / np.sqrt(6) / change
        noisy = value > NOISY
        hint = "no error at 0.25 s will be below this share of the change: smooth = 5, or a better source"
        yield Check("noise", 100 * value, "%", "1 to 20", "note" if noisy else "ok", hint if noisy else "", name)


def _magnitudes(log: Measured) -> Iterator[Check]:
    """Whether a signal is as large as its unit lets it be, where that can be told."""
    for name, values in log.signals.items():
        limits = quantities.LIMITS.get(name)
        if limits is None or len(values) < FEWEST or not values.any():
            continue
        value = float(np.median(np.abs(values))) if limits.usual else most(values)
        odd = not limits.low <= value <= limits.high
        healthy = f"{limits.low:g} to {limits.high:g}" if limits.low else f"at most {limits.high:g}"
        yield Check("magnitude", value, limits.unit, healthy, "ask" if odd else "ok", limits.hint if odd else "", name)


def _above(value: float, warn: float, ask: float) -> Verdict:
    return "ask" if value > ask else "warn" if value > warn else "ok"


def _below(value: float, warn: float, ask: float) -> Verdict:
    return "ask" if value < ask else "warn" if value < warn else "ok"


def _within(value: float, limits: tuple[float, float]) -> bool:
    return limits[0] <= value <= limits[1]
