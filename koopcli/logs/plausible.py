"""Whether the signals of a log fit together as those of a car do, and what would mend them.

Signals are known by their names, as states or as inputs: v_x, v_y, yaw_rate, steer (and a_z). In SI and radians.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from koopcli.logs import quantities
from koopcli.logs.check import Check
from koopcli.logs.hints import KMH, SPEED, Said, unit_hint
from koopcli.logs.measures import FEWEST, SPIKE, Measured, explained, most, rms, scaled, varies
from koopcli.logs.turning import turning_checks
from koopcli.records import Episodes

Places = Mapping[str, str]  # file and column of each signal

LONGITUDINAL, LONGITUDINAL_SMALL, SMALL = 15.0, 40.0, 1.0  # m/s², of a car and of one with a wheelbase below 1 m
SPAN, DRIVEN = 0.5, 0.3  # s; R²
UNCHANGED, NOISY, NOISE_SPAN = 0.10, 0.20, 0.25  # shares; s
SLOPE_SPAN = 0.05  # s, over which dv/dt is taken on finer grids
COPIED = 0.9995  # a correlation; with other noise a speed is the same one to within this


def checks_of(
    episodes: Episodes, wheelbase: float | None = None, said: Said | None = None, places: Sequence[Places] = ()
) -> list[Check]:
    """The checks of ``episodes`` that their signals allow; ``wheelbase`` in m, None where it is unknown.

    ``said``: what the map says of units and of the ratio of the steering, so that no hint proposes what is there;
    ``places``: for each run the file and column of each signal, for hints. A check whose signals are missing, never
    change or have too few rows is not made. No difference and no lag crosses the seam between two episodes.
    """
    log = Measured(episodes, wheelbase, said or Said())
    makers = (turning_checks, _longitudinal, _drive, _copies, _unchanged, _noise, _magnitudes)
    with np.errstate(divide="ignore", invalid="ignore"):  # values that are not finite are not reported
        checks = [*_spikes(log, places), *(check for make in makers for check in make(log))]
    return [check for check in checks if np.isfinite(check.value)]


def _spikes(log: Measured, places: Sequence[Places]) -> Iterator[Check]:
    """The largest deviation from the median of the signals that jump there and back; else the largest of all."""
    spikes = log.spikes
    jumping = [name for name, spike in spikes.items() if len(spike.rows)]
    for name in jumping or sorted(spikes, key=lambda name: -spikes[name].size)[:1]:
        spike = spikes[name]
        row = int(spike.rows[0]) if name in jumping else spike.row
        hint = ""
        if name in jumping:
            run = int(log.episodes.runs[np.searchsorted(log.episodes.bounds, row, side="right") - 1])
            where = f" of {places[run][name]}" if run < len(places) and name in places[run] else ""
            rows = f"{len(spike.rows)} row{'s' * (len(spike.rows) > 1)}"
            hint = (
                f"{rows} jump there and back, the first at {log.episodes.time[row]:.6g} s{where}: take them out of "
                "the file; the other checks leave them out"
            )
        value = spike.size
        yield Check("spike", value, "1", f"at most {SPIKE:g}, or slower", "warn" if hint else "ok", hint, name)


def _copies(log: Measured) -> Iterator[Check]:
    """Whether an input is a state once more: it would predict itself."""
    inputs, states = log.episodes.input_channels.names, log.episodes.state_channels.names
    if len(log.x) < FEWEST or not (len(inputs) and len(states)):
        return
    table = np.abs(np.nan_to_num(scaled(log.u).T @ scaled(log.x) / len(log.x)))
    most_alike = divmod(int(np.argmax(table)), table.shape[1])
    alike = [(int(i), int(k)) for i, k in np.argwhere(table > COPIED)]
    for i, k in alike or [most_alike] * bool(table.any()):
        copied = bool(table[i, k] > COPIED)
        hint = f"it is {states[k]} once more: a state is no input of itself, take it out of the map" if copied else ""
        yield Check("copy", float(table[i, k]), "1", f"at most {COPIED:g}", "warn" if copied else "ok", hint, inputs[i])


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
    unit = f"is v_x in km/h (unit = 'km/h', factor {KMH:g}), or " if log.said.lacks(SPEED) else ""
    hint = f"{unit}does it jump{unknown}?" if value > limit else ""
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
    yield Check("drive", value, "1", f"{DRIVEN:g} to 0.9, at least {DRIVEN:g}", "note" if weak else "ok", hint, "v_x")


def _unchanged(log: Measured) -> Iterator[Check]:
    rows = log.pairs(1)
    if len(rows) < FEWEST:
        return
    for name, values in zip(log.episodes.state_channels.names, log.x.T, strict=True):
        value = float((values[rows + 1] == values[rows]).mean())
        often = value > UNCHANGED
        hint = "it is coarse, or slower than the grid: a longer dt" if often else ""
        yield Check("unchanged", 100 * value, "%", "below 1, at most 10", "note" if often else "ok", hint, name)


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
        yield Check("noise", 100 * value, "%", "at most 20", "note" if noisy else "ok", hint if noisy else "", name)


def _magnitudes(log: Measured) -> Iterator[Check]:
    """Whether a signal is as large as its unit lets it be, where that can be told."""
    for name, values in log.signals.items():
        limits = quantities.LIMITS.get(name)
        if limits is None or len(values) < FEWEST or not values.any():
            continue
        value = float(np.median(np.abs(values))) if limits.usual else most(values)
        odd = not limits.low <= value <= limits.high
        healthy = f"{limits.low:g} to {limits.high:g}" if limits.low else f"at most {limits.high:g}"
        other = "the map has that unit already: is it another column?"
        hint = unit_hint(log.said, ((name, limits.other), limits.factor), otherwise=other) if odd else ""
        yield Check("magnitude", value, limits.unit, healthy, "ask" if odd else "ok", hint, name)
