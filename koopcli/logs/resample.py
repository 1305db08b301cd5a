"""Channels that were sampled each at its own times, on one grid; where one is silent, no row is invented (10.1)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from koopcli.blocks import blocks
from koopcli.logs.derived import restarts_of
from koopcli.records import BoolArray, FloatArray

NEAR = 1e-3  # steps: a sample that is nearer to a row of the grid belongs to it
BLOCK = 100_000  # rows of the grid that are held in memory more than once
BRIDGED = 3.0  # own steps: what is longer was interpolated over more than one missing sample


@dataclass(frozen=True, eq=False)
class Channel:
    """The samples of a signal that are numbers: ``values`` (n,) in SI at ``time`` (n,) in s, rising.

    ``end`` (s): until when it counts; a value that is held does so beyond its last sample.
    """

    time: FloatArray
    values: FloatArray
    end: float


def grid_of(channels: Sequence[Channel], dt: float) -> FloatArray:
    """The times in s every ``dt`` from the latest beginning to the earliest end of all ``channels``; may be empty."""
    start = max(channel.time[0] for channel in channels)
    end = min(channel.end for channel in channels)
    return np.asarray(start + dt * np.arange(int(np.floor((end - start) / dt + NEAR)) + 1))


def silences(time: FloatArray, gap: float) -> tuple[FloatArray, FloatArray]:
    """Last and first samples around the silences that are longer than ``gap`` s and than five steps, each (m,)."""
    begins = np.flatnonzero(restarts_of(time, gap)[1:])
    return time[begins], time[begins + 1]


def bridges(time: FloatArray, gap: float, dt: float) -> tuple[FloatArray, FloatArray]:
    """Last and first samples around shorter silences of more than three own steps and two ``dt``, each (m,)."""
    steps = np.diff(time)
    long = (steps > max(BRIDGED * float(np.median(steps)), 2 * dt)) & ~restarts_of(time, gap)[1:]
    return time[:-1][long], time[1:][long]


def between(grid: FloatArray, intervals: tuple[FloatArray, FloatArray], dt: float) -> BoolArray:
    """Which times of the ``grid`` (k,) lie inside one of the ``intervals``, ends excluded."""
    inside = np.zeros(len(grid) + 1, dtype=np.int64)
    np.add.at(inside, np.searchsorted(grid, intervals[0] + NEAR * dt, side="right"), 1)
    np.add.at(inside, np.searchsorted(grid, intervals[1] - NEAR * dt, side="left"), -1)
    return np.asarray(np.cumsum(inside[:-1]) > 0)


def interpolated(grid: FloatArray, channel: Channel) -> FloatArray:
    """The values of a channel at the times of the ``grid``, linear between samples, (k,)."""
    return np.asarray(np.interp(grid, channel.time, channel.values))


def held_last(grid: FloatArray, channel: Channel, dt: float) -> FloatArray:
    """The last value of a channel up to each time of the ``grid``, (k,)."""
    return np.asarray(channel.values[_latest(channel.time, grid + NEAR * dt)])


def held_mean(grid: FloatArray, channel: Channel, dt: float) -> FloatArray:
    """The mean over [t_k, t_k + dt) of the value that a channel holds, for each time of the ``grid``, (k,)."""
    parts = [_held_mean(grid[rows], channel, dt) for rows in blocks(slice(0, len(grid)), BLOCK)]
    return np.concatenate(parts) if parts else np.empty(0)


def _held_mean(grid: FloatArray, channel: Channel, dt: float) -> FloatArray:
    edges = np.append(grid, grid[-1] + dt)
    first, last = np.searchsorted(channel.time, [edges[0], edges[-1]], side="right")
    inner = channel.time[first:last]
    times = np.concatenate([edges, inner])
    times.sort(kind="stable")
    widths = np.diff(times)
    values = channel.values[_latest(channel.time, times[:-1])]
    begins = np.searchsorted(times[:-1], grid, side="left")
    base = values[begins]  # the rest is a small correction: a value that stands is exact
    shift = np.add.reduceat((values - np.repeat(base, np.diff(np.append(begins, len(values))))) * widths, begins)
    return np.asarray(base + shift / dt)


def stretches(kept: BoolArray, least: int) -> tuple[list[slice], int]:
    """The runs of at least ``least`` rows that are ``kept`` (k,), and how many shorter ones were left out."""
    turns = np.diff(np.concatenate([[0], kept.astype(np.int8), [0]]))
    slices = [slice(int(a), int(b)) for a, b in zip(np.flatnonzero(turns > 0), np.flatnonzero(turns < 0), strict=True)]
    long = [rows for rows in slices if rows.stop - rows.start >= least]
    return long, len(slices) - len(long)


def sensible_step(step: float) -> float:
    """A median ``step`` in s, rounded to one digit where that is within 3 %, else to two."""
    short = float(f"{step:.0e}")
    return short if abs(short - step) <= 0.03 * step else float(f"{step:.1e}")


def _latest(time: FloatArray, moments: FloatArray) -> np.ndarray:
    return np.maximum(np.searchsorted(time, moments, side="right") - 1, 0)
