"""What the times of a log are like: how regular, how often repeated, how often silent."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.logs.check import Check
from koopcli.logs.clock import Clock
from koopcli.logs.entries import LogMap, Source
from koopcli.logs.recording import Recording

JITTER = 0.2  # of dt
SLOW, INVENTED = 2.0, 20.0  # dt: steps of a state that ask, and that are refused
USUAL = 0.95  # the share of steps that differ by less from their median


def jitter_of(clock: Clock, dt: float) -> float:
    """How far the steps of a clock lie from their median, of ``dt``: 95 % of them within it."""
    steps = np.diff(clock.time)
    return float(np.quantile(np.abs(steps - np.median(steps)), USUAL) / dt) if len(steps) else 0.0


def time_checks(clocks: Sequence[Mapping[str, Clock]], dt: float, silent: Mapping[str, Sequence[float]]) -> list[Check]:
    """The checks of the ``clocks`` by source, one mapping for each run.

    ``silent``: the lengths in s of the silences that ended an episode, by signal.
    """
    jitters: dict[str, float] = {}
    for run in clocks:
        for name, clock in run.items():
            jitters[name] = max(jitters.get(name, 0.0), jitter_of(clock, dt))
    worst = max(jitters, key=lambda name: jitters[name])
    repeated = {name: sum(run[name].repeated for run in clocks if name in run) for name in jitters}
    first = [name for name in jitters if any(run[name].first for run in clocks if name in run)]
    lengths = [length for each in silent.values() for length in each]
    uneven = jitters[worst] > JITTER
    return [
        Check(
            "time_jitter",
            jitters[worst],
            "dt",
            f"0 to {JITTER:g}",
            "note" if uneven else "ok",
            f"source {worst} is sampled unevenly: its rows are resampled onto the grid" if uneven else "",
        ),
        Check(
            "repeated_time",
            float(sum(repeated.values())),
            "1",
            "0",
            "note" if any(repeated.values()) else "ok",
            f"of rows with one time the last counts: {_counts(repeated)}" if any(repeated.values()) else "",
        ),
        Check(
            "gaps",
            float(max(map(len, silent.values()), default=0)),
            "1",
            "0",
            "note" if lengths else "ok",
            f"an episode ends at each, the longest lasts {max(lengths):.3g} s: {_counts(silent)}" if lengths else "",
        ),
        Check(
            "first_row",
            float(len(first)),
            "1",
            "0",
            "note" if first else "ok",
            f"a first row later than the second was left out: {', '.join(first)}" if first else "",
        ),
    ]


def _counts(values: Mapping[str, int] | Mapping[str, Sequence[float]]) -> str:
    numbers = {name: value if isinstance(value, int) else len(value) for name, value in values.items()}
    return ", ".join(f"{number} of {name}" for name, number in numbers.items() if number)


def state_steps(recording: Recording, log_map: LogMap) -> dict[str, float]:
    """The median step in s of each state of a recording, by its result. Inputs may be slow: commands are held."""
    times = {signal.result: recording.channels[signal.name].time for signal in log_map.states}
    return {name: float(np.median(np.diff(time))) for name, time in times.items() if len(time) > 1}


def check_steps(steps: Mapping[str, float], log_map: LogMap, dt: float) -> None:
    """Raise ``InvalidValueError`` for a state whose ``steps`` (s, by its result) are so long that rows are invented."""
    for signal in log_map.states:
        step = steps.get(signal.result, 0.0)
        if step > INVENTED * dt:
            (source,) = (source for source in log_map.sources if source.name == signal.source)
            raise InvalidValueError(
                f"{signal.name} of source.{source.name} comes every {step:.3g} s and log.dt is {dt:g} s: at most "
                f"{INVENTED:g} dt was expected, since rows between are invented; {_mending(source, step)}"
            )


def slow_checks(steps: Sequence[Mapping[str, float]], dt: float) -> list[Check]:
    """The check of states that are slower than the grid; ``steps`` in s by state, one mapping for each run."""
    longest = {name: max(run[name] for run in steps if name in run) / dt for run in steps for name in run}
    slow = [name for name, step in longest.items() if step > SLOW]
    checks = []
    for name in slow or sorted(longest, key=lambda name: -longest[name])[:1]:
        step = longest[name]
        hint = f"rows between its samples are invented: dt = {step * dt:.2g}, or is the unit of its time wrong?"
        hint = hint if name in slow else ""
        checks.append(
            Check("slow_source", step, "dt", f"at most {SLOW:g}", "ask" if name in slow else "ok", hint, name)
        )
    return checks


def _mending(source: Source, step: float) -> str:
    unit = source.time.unit or "s"
    smaller = {"s": "ms", "ms": "us", "us": "ns"}.get(unit, "")
    counted = source.time.rate is None and not source.time.format and source.time.s is None
    asked = f"is its time in {smaller} (unit = '{smaller}'; now {unit})? Else " if counted and smaller else ""
    return f"{asked}say dt = {step:.2g}, map a faster column, or make it an input"
