"""The channels of one run on the grid: states, inputs, and the rows that lie in episodes."""

from __future__ import annotations

import operator
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from koopcli.logs.entries import Condition, LogMap, Signal
from koopcli.logs.resample import (
    Channel,
    between,
    bridges,
    grid_of,
    held_last,
    held_mean,
    interpolated,
    silences,
    stretches,
)
from koopcli.records import BoolArray, FloatArray

SHARE = 1.002  # of a step: a silence that ends an episode is longer, so that a row lies in it
COMPARED = {">": operator.gt, ">=": operator.ge, "<": operator.lt, "<=": operator.le}


@dataclass(frozen=True, eq=False)
class Gridded:
    """The rows of one run that lie in episodes: ``x`` (rows, n_x), ``u`` (rows, n_u), ``flagged`` (rows,).

    ``lengths`` and ``starts``: rows and time in s of each episode; ``short``: stretches that were too short;
    ``shared``: the rows that all channels have; ``silent``: the lengths in s of the silences of each signal.
    """

    x: FloatArray
    u: FloatArray
    flagged: BoolArray
    lengths: list[int]
    starts: list[float]
    short: int
    shared: int
    silent: Mapping[str, list[float]]


def gridded(channels: dict[str, Channel], log_map: LogMap, dt: float) -> Gridded:
    """The ``channels`` of a run, by the names in the map, every ``dt`` s. Channels are taken out once they are used.

    None is left, so that memory does not hold what was put onto the grid.
    """
    grid = grid_of(list(channels.values()), dt)
    gap = max(log_map.gap, SHARE * dt)
    kept, flagged = np.ones(len(grid), dtype=bool), np.zeros(len(grid), dtype=bool)
    silent: dict[str, list[float]] = {}
    for name, channel in channels.items():
        begins, ends = silences(channel.time, gap)
        within = (ends > grid[0]) & (begins < grid[-1]) if len(grid) else np.zeros(len(begins), dtype=bool)
        silent[name] = (ends - begins)[within].tolist()
        kept &= ~between(grid, (begins, ends), dt)
        flagged |= between(grid, bridges(channel.time, gap, dt), dt)
    for condition in log_map.keep:
        kept &= _holds(condition, grid, channels, log_map, dt)
    least = max(2, int(np.ceil(log_map.shortest / dt - 1e-6)) + 1)
    slices, short = stretches(kept, least)
    x, u = _values(grid, slices, channels, log_map, dt)
    channels.clear()
    flagged = np.concatenate([flagged[part] for part in slices]) if slices else flagged[:0]
    lengths = [part.stop - part.start for part in slices]
    starts = [float(grid[part.start]) for part in slices]
    return Gridded(x, u, flagged, lengths, starts, short, len(grid), silent)


def roles(log_map: LogMap) -> tuple[list[Signal], list[Signal]]:
    """The signals that are states, and those that are inputs: exogenous states come behind the others."""
    states = [signal for signal in log_map.states if signal.result not in log_map.exogenous]
    moved = [signal for signal in log_map.states if signal.result in log_map.exogenous]
    return states, [*log_map.inputs, *moved]


def _values(
    grid: FloatArray, slices: list[slice], channels: dict[str, Channel], log_map: LogMap, dt: float
) -> tuple[FloatArray, FloatArray]:
    states, inputs = roles(log_map)
    rows = sum(part.stop - part.start for part in slices)
    x, u = np.empty((rows, len(states))), np.empty((rows, len(inputs)))
    if not rows:
        return x, u
    needed = {"v_x", "yaw_rate"} if any(s.result == "v_y" for s in log_map.signals) else set()
    ordered = [*((x, i, signal, False) for i, signal in enumerate(states))]
    ordered += [*((u, i, signal, True) for i, signal in enumerate(inputs))]
    for values, column, signal, held in sorted(ordered, key=lambda each: each[2].name in needed):
        channel = channels[signal.name]
        if signal.result == "v_y":
            on_grid = _side_speed(signal, grid, channels)
        elif not held:
            on_grid = interpolated(grid, channel)
        else:
            on_grid = held_mean(grid, channel, dt) if signal.hold == "mean" else held_last(grid, channel, dt)
        first = 0
        for part in slices:
            values[first : first + part.stop - part.start, column] = on_grid[part]
            first += part.stop - part.start
        if signal.name not in needed:
            del channels[signal.name]
    return x, u


def _side_speed(signal: Signal, grid: FloatArray, channels: Mapping[str, Channel]) -> FloatArray:
    """v_y at the centre, in m/s: of a side slip v_x tan(side slip); less the lever times the yaw rate."""
    values = interpolated(grid, channels[signal.name])
    if signal.name == "side_slip":
        values = interpolated(grid, channels["v_x"]) * np.tan(values)
    return values - signal.lever * interpolated(grid, channels["yaw_rate"]) if signal.lever else values


def _holds(
    condition: Condition, grid: FloatArray, channels: Mapping[str, Channel], log_map: LogMap, dt: float
) -> BoolArray:
    named = [s for s in log_map.signals if condition.signal in (s.name, s.result)]
    signal = named[0]
    if condition.signal == "v_y":
        values = _side_speed(signal, grid, channels)
    elif signal in log_map.states:
        values = interpolated(grid, channels[signal.name])
    else:
        values = held_last(grid, channels[signal.name], dt)
    return np.asarray(COMPARED[condition.comparison](values, condition.value))
