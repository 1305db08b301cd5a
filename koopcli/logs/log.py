"""Files and a map in, a log out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.logs.entries import LogMap
from koopcli.logs.files import Run, expand, runs_of, unused
from koopcli.logs.gridding import Gridded, gridded, roles
from koopcli.logs.hints import Said
from koopcli.logs.imported import Log
from koopcli.logs.plausible import checks_of
from koopcli.logs.recording import Recording, recording_of, units_of
from koopcli.logs.resample import sensible_step
from koopcli.logs.timing import check_steps, slow_checks, state_steps, time_checks
from koopcli.logs.units import known, unit
from koopcli.progress import Progress, silent
from koopcli.records import Channels, Episodes, FloatArray

__all__ = ["Log", "expand", "import_log"]

BRIEF = 5.0  # s: no log is so short
LISTED = 5  # names in one note


def import_log(files: Sequence[Path], log_map: LogMap, progress: Progress = silent) -> Log:
    """The log in ``files`` as the map says: read, mended, put onto one grid, cut into episodes and checked.

    Raises ``InvalidValueError`` for files that are missing, empty or hold no numbers, a time that goes back or stands,
    a mapped column that is constant, a copy of another one or without a number, and a log without an episode.
    """
    runs = runs_of(files, log_map)
    total = len(runs) * len(log_map.used)
    done = iter(range(1, total + 1))
    recordings: list[Recording] = []
    parts: list[Gridded] = []
    steps: list[Mapping[str, float]] = []
    digests: dict[tuple[bytes, ...], Run] = {}
    notes: list[str] = []
    for run in runs:
        recording = recording_of(run, log_map, lambda: progress(next(done), total))
        digest = tuple(heard.digest for heard in recording.heard.values())
        if digest in digests:
            notes.append(f"run {_short(run)} holds the numbers of run {_short(digests[digest])}: left out")
            continue
        digests[digest] = run
        recordings.append(recording)
        _check_numbers(log_map, recording)
        steps.append(state_steps(recording, log_map))
        if log_map.dt is not None and len(runs) > 1:
            check_steps(steps[-1], log_map, log_map.dt)
            parts.append(gridded(recording.channels, log_map, log_map.dt))
    _check_columns(log_map, recordings)
    dt = _auto_step(log_map, recordings) if log_map.dt is None else log_map.dt
    for each in steps:
        check_steps(each, log_map, dt)
    parts = parts or [gridded(recording.channels, log_map, dt) for recording in recordings]
    log = _log(list(digests.values()), recordings, parts, steps, log_map, dt)
    return replace(log, notes=(*_unused(files, runs), *notes, *log.notes))


def _short(run: Run) -> str:
    return Path(run.name).name if run.name and not run.name.isdigit() else ", ".join(p.name for p in run.files.values())


def _log(
    runs: Sequence[Run],
    recordings: Sequence[Recording],
    parts: Sequence[Gridded],
    steps: Sequence[Mapping[str, float]],
    log_map: LogMap,
    dt: float,
) -> Log:
    units = units_of(log_map, recordings[0])
    states, inputs = (
        Channels(tuple(s.result for s in role), tuple(units[s.result][0] for s in role)) for role in roles(log_map)
    )
    lengths = [length for part in parts for length in part.lengths]
    _check_rows(lengths, parts, runs, recordings, log_map)
    episodes = Episodes(
        x=_joined([part.x for part in parts]),
        u=_joined([part.u for part in parts]),
        dt=dt,
        bounds=np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64),
        starts=np.array([start for part in parts for start in part.starts]),
        runs=np.repeat(np.arange(len(parts)), [len(part.lengths) for part in parts]).astype(np.int64),
        state_channels=states,
        input_channels=inputs,
    )
    _check_constant(episodes)
    lengths_of = {signal.name: [s for part in parts for s in part.silent[signal.name]] for signal in log_map.signals}
    checks = [*time_checks([recording.clocks for recording in recordings], dt, lengths_of), *slow_checks(steps, dt)]
    said = Said({name: shown for name, (_, shown) in units.items()}, _ratio(log_map))
    places = [{s.result: recording.heard[s.name].place for s in log_map.signals} for recording in recordings]
    return Log(
        episodes=episodes,
        checks=(*checks, *checks_of(episodes, log_map.wheelbase, said, places)),
        notes=tuple(_notes(runs, recordings, parts, log_map)),
        wheelbase=log_map.wheelbase,
        display=dict(said.units),
        flagged=np.concatenate([part.flagged for part in parts]),
    )


def _joined(parts: Sequence[FloatArray]) -> FloatArray:
    return parts[0] if len(parts) == 1 else np.concatenate(parts)


def _auto_step(log_map: LogMap, recordings: Sequence[Recording]) -> float:
    """The median step of the slowest state, in s, rounded."""
    steps = []
    for signal in log_map.states:
        times = [recording.channels[signal.name].time for recording in recordings]
        steps.append(float(np.median(np.concatenate([np.diff(time) for time in times]))))
    return sensible_step(max(steps))


def _check_numbers(log_map: LogMap, recording: Recording) -> None:
    for signal in log_map.signals:
        if len(recording.channels[signal.name].time) < 2:
            raise InvalidValueError(
                f"{recording.heard[signal.name].place} ({signal.name}) holds fewer than two numbers: map another "
                "column, or leave that file out"
            )


def _check_columns(log_map: LogMap, recordings: Sequence[Recording]) -> None:
    """No mapped column may be constant, or a copy of another one."""
    digests: dict[tuple[bytes, ...], str] = {}
    for signal in log_map.signals:
        heard = [recording.heard[signal.name] for recording in recordings]
        if min(each.low for each in heard) == max(each.high for each in heard):
            raise InvalidValueError(
                f"{heard[0].place} ({signal.name}) is {heard[0].low:g} throughout: map a column that changes, or "
                "take it out of the map"
            )
        digest = tuple(each.digest for each in heard)
        if digest in digests and not signal.heading:
            raise InvalidValueError(
                f"{heard[0].place} ({signal.name}) is a copy of what is mapped as {digests[digest]}: map another column"
            )
        digests[digest] = signal.name


def _check_rows(
    lengths: Sequence[int],
    parts: Sequence[Gridded],
    runs: Sequence[Run],
    recordings: Sequence[Recording],
    log_map: LogMap,
) -> None:
    if lengths:
        return
    if not any(part.shared for part in parts):
        spans = "; ".join(
            f"{name} from {clock.time[0]:.6g} to {clock.time[-1]:.6g} s" for name, clock in recordings[0].clocks.items()
        )
        raise InvalidValueError(
            f"the sources share no time ({spans}): mend the unit of a time, or say offset in the map"
        )
    short = sum(part.short for part in parts)
    why = f", {short} shorter than log.shortest = {log_map.shortest:g} s" if short else ""
    rows = sum(part.shared for part in parts)
    longest = max(clock.time[-1] - clock.time[0] for recording in recordings for clock in recording.clocks.values())
    timed = f"; the longest run lasts {longest:.3g} s: is the unit of its time right?" if longest < BRIEF else ""
    raise InvalidValueError(f"no episode is left of {rows} rows{why}: loosen keep, gap or shortest{timed}")


def _check_constant(episodes: Episodes) -> None:
    for values, channels in ((episodes.x, episodes.state_channels), (episodes.u, episodes.input_channels)):
        for column, name in enumerate(channels.names):
            if values[:, column].min() == values[:, column].max():
                raise InvalidValueError(
                    f"{name} is {values[0, column]:g} in all rows that are kept: loosen keep, or take it out of the map"
                )


def _ratio(log_map: LogMap) -> float:
    """The ratio of the steering that the map says."""
    return next((abs(signal.ratio) for signal in log_map.signals if signal.name == "steer"), 1.0)


def _unused(files: Sequence[Path], runs: Sequence[Run]) -> list[str]:
    others = unused(files, runs)
    if not others:
        return []
    names = ", ".join("/".join(path.parts[-2:]) for path in others[:LISTED])
    more = f" and {len(others) - LISTED} more" if len(others) > LISTED else ""
    return [f"{len(others)} file{'s' * (len(others) > 1)} not in the map: {names}{more}"]


def _notes(
    runs: Sequence[Run], recordings: Sequence[Recording], parts: Sequence[Gridded], log_map: LogMap
) -> list[str]:
    notes = []
    short = sum(part.short for part in parts)
    if short:
        each = "stretches" if short > 1 else "stretch"
        notes.append(f"{short} {each} shorter than {log_map.shortest:g} s left out")
    for run, part in zip(runs, parts, strict=True):
        if not part.lengths:
            notes.append(f"run {Path(run.name).name or run.name} has no episode")
    untimed = sum(clock.untimed for recording in recordings for clock in recording.clocks.values())
    if untimed:
        notes.append(f"{untimed} row{'s' * (untimed > 1)} without a time left out")
    for signal in log_map.signals:
        measured, said = recordings[0].heard[signal.name].unit, recordings[0].heard[signal.name].said
        if signal.unit is not None and known(said) and unit(said) != measured:
            notes.append(f"{signal.name} taken in {measured.name}, as the map says; its file says {said}")
        if signal.unit is None and measured.name not in ("1", measured.si):
            notes.append(f"{signal.name} taken in {measured.name}, as its file says")
    return notes
