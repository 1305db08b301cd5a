"""One run of a log: its sources are read, their times mended, and each signal becomes a channel in SI."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from hashlib import blake2b

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.logs.clock import Clock, mended, place_in, time_columns, times_of
from koopcli.logs.derived import causal_mean, heading_rate, restarts_of
from koopcli.logs.entries import SI, LogMap, Signal, Source
from koopcli.logs.files import Run
from koopcli.logs.formats import open_table
from koopcli.logs.formats.table import Table
from koopcli.logs.resample import Channel
from koopcli.logs.signal_keys import si_of
from koopcli.logs.units import Unit, known, unit
from koopcli.records import FloatArray


@dataclass(frozen=True, eq=False)
class Heard:
    """What is known of one signal in one run, but for its channel.

    ``digest`` of its raw values, ``low`` and ``high`` of them (nan where none is a number), ``unit`` they are in,
    ``said``, the unit in the file or "", and ``place``: file and column, for errors.
    """

    digest: bytes
    low: float
    high: float
    unit: Unit
    said: str
    place: str


@dataclass(frozen=True, eq=False)
class Recording:
    """One run: the channel of each signal by its name in the map, what is known of it, and the clocks by source."""

    channels: dict[str, Channel]
    heard: dict[str, Heard]
    clocks: dict[str, Clock]


def recording_of(run: Run, log_map: LogMap, advance: Callable[[], None]) -> Recording:
    """Read a ``run``; ``advance`` is called after each source. Raises ``InvalidValueError`` for what cannot be used."""
    recording = Recording({}, {}, {})
    for source in log_map.used:
        signals = [signal for signal in log_map.signals if signal.source == source.name]
        _read(source, signals, run, log_map, recording)
        advance()
    return recording


def _read(source: Source, signals: Sequence[Signal], run: Run, log_map: LogMap, recording: Recording) -> None:
    table = open_table(run.files[source.name], source)
    apart = run.times.get(source.name)
    timed = open_table(apart, Source("")) if apart is not None else table
    places = {signal.name: _places(signal, table) for signal in signals}
    columns: dict[int, FloatArray] = {}
    if table.stamps is None:
        timing = time_columns(source, timed) if apart is None else []
        wanted = list(dict.fromkeys([*timing, *(place for chosen in places.values() for place in chosen)]))
        columns = dict(zip(wanted, table.read(wanted), strict=True))
        if timing:  # a file is read once
            timed = replace(table, read=lambda asked: [columns[place] for place in asked])
    clock: Clock | None = None
    rows = 0
    for i, signal in enumerate(signals):
        chosen = places[signal.name]
        if table.stamps is not None:
            columns = dict(zip(chosen, table.read(chosen), strict=True))
        raw = _reduced(signal, [columns[place] for place in chosen], table)
        if clock is None or table.stamps is not None:
            time = times_of(source, timed, max(len(columns[place]) for place in chosen), chosen[0])
            rows = len(time)
            clock = mended(time, place_in(timed))
            recording.clocks[source.name if i == 0 else f"{source.name}, {signal.name}"] = clock
        measured = _unit_of(signal, table, chosen[0])
        later = {place for other in signals[i + 1 :] for place in places[other.name]}
        for column in set(columns) - later:
            del columns[column]
        place = f"{table.path}, column '{_title(signal, table, chosen)}'"
        raw = _fitted(raw, rows, signal in log_map.inputs, place)
        recording.heard[signal.name] = _heard(raw, measured, table.units[chosen[0]], place)
        recording.channels[signal.name] = _channel(signal, raw, clock, measured, log_map)


def _places(signal: Signal, table: Table) -> list[int]:
    if signal.axis is None:
        return [table.place(column) for column in signal.columns]
    columns = signal.columns or (None,)
    return [table.of_axis(column, signal.axis) for column in columns]


def _title(signal: Signal, table: Table, places: Sequence[int]) -> str:
    return ", ".join(table.names[place] or str(place) for place in places)


def _reduced(signal: Signal, columns: Sequence[FloatArray], table: Table) -> FloatArray:
    if len({len(values) for values in columns}) > 1:
        raise InvalidValueError(
            f"{table.path}: the columns of {signal.name} differ in length: map columns of one table"
        )
    if len(columns) == 1:
        return columns[0]
    total = np.sum(columns, axis=0)
    return np.asarray(total / len(columns) if signal.reduce == "mean" else total)


def _unit_of(signal: Signal, table: Table, place: int) -> Unit:
    """The unit that the map says, else that of the file where it fits, else SI."""
    wanted = "rad" if signal.heading else SI.get(signal.name, "")
    said = table.units[place]
    if signal.unit is not None:
        return unit(signal.unit)
    if known(said) and (not wanted or unit(said).si == wanted):
        return unit(said)
    return unit(wanted or "1")


def _fitted(raw: FloatArray, rows: int, held: bool, place: str) -> FloatArray:
    """As many values as there are times: an input that is one row shorter has no last one."""
    if len(raw) == rows:
        return raw
    if held and len(raw) == rows - 1:
        return np.append(raw, np.nan)
    raise InvalidValueError(f"{place} has {len(raw)} rows, its time {rows}: as many were expected, map another time")


def _heard(raw: FloatArray, measured: Unit, said: str, place: str) -> Heard:
    finite = raw if np.isfinite(raw.sum()) else raw[np.isfinite(raw)]
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (np.nan, np.nan)
    return Heard(blake2b(np.ascontiguousarray(finite).data, digest_size=16).digest(), low, high, measured, said, place)


def _channel(signal: Signal, raw: FloatArray, clock: Clock, measured: Unit, log_map: LogMap) -> Channel:
    """The samples that are numbers, in SI. With none of them the channel is empty."""
    time, values = clock.time, raw[clock.rows]
    end = float(time[-1])
    kept = np.isfinite(values)
    held = signal in log_map.inputs and len(time) > 1 and not kept[-1] and bool(kept[-2])
    if not kept.all():
        time, values = time[kept], values[kept]
    values = values * (signal.sign * measured.factor / signal.ratio)
    if len(time) and signal.heading:
        time, values = _numbers(time, heading_rate(time, values, signal.width, restarts_of(time, log_map.gap)))
    if len(time) and signal.smooth > 1:
        time, values = _numbers(time, causal_mean(values, signal.smooth, restarts_of(time, log_map.gap)))
    return Channel(time, values, end if held or not len(time) else float(time[-1]))


def _numbers(time: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    kept = np.isfinite(values)
    return time[kept], values[kept]


def units_of(log_map: LogMap, recording: Recording) -> Mapping[str, tuple[str, str]]:
    """For each signal by its result: the SI unit, and the unit that the user reads it in."""
    units = {}
    for signal in log_map.signals:
        measured = recording.heard[signal.name].unit
        si = si_of(signal) or measured.si
        shown = measured.name
        if signal.heading:
            shown = f"{measured.name}/s"
        elif signal.result != signal.name:
            shown = si
        units[signal.result] = (si, shown)
    return units
