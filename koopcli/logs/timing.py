"""What the times of a log are like: how regular, how often repeated, how often silent."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from koopcli.logs.check import Check
from koopcli.logs.clock import Clock

JITTER = 0.2  # of dt
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
