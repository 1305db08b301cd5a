"""What a map says: where the columns of a log are, and which signals they are."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

Column = int | str
GAP = 0.3  # s
SHORTEST = 2.5  # s
WIDTH = 0.1  # s
SI = {"v_x": "m/s", "v_y": "m/s", "yaw_rate": "rad/s", "side_slip": "rad", "steer": "rad"}  # what the checks know


@dataclass(frozen=True)
class Time:
    """How the time of a source is found; with nothing said, in column 0 in s.

    ``column`` in ``unit``, "" for that in the file or s, or written as ``format``; or two columns ``s`` and ``ns``; or
    ``rate`` in Hz, from 0 s. ``file``: the end of the path of the file that holds it.
    """

    column: Column | None = None
    unit: str = ""
    s: Column | None = None
    ns: Column | None = None
    format: str = ""
    rate: float | None = None
    file: str = ""


@dataclass(frozen=True)
class Source:
    """A file of a log, by the end of its path, with how it is written.

    ``offset`` (s) is added to its time. What is None is looked for in the file; 0 for a line says that it has none.
    """

    name: str
    file: str = ""
    time: Time = field(default_factory=Time)
    offset: float = 0.0
    delimiter: str | None = None
    decimal: str | None = None
    comment: str | None = None
    header: int | None = None
    units_row: int | None = None
    unquote_rows: bool | None = None


@dataclass(frozen=True)
class Signal:
    """A state or an input: sign × factor of the unit × raw / ratio, of one column or several that are reduced to one.

    ``unit``: None where the map does not say it. ``hold``: "mean" over the step or "last". ``smooth``: so many raw
    samples in a causal mean. ``heading``: its rate over the past ``width`` s. ``lever``: m that the sensor is ahead of
    the centre. ``axis``: 0, 1 or 2 for a column of a vector, None for no vector.
    """

    name: str
    source: str
    columns: tuple[Column, ...]
    unit: str | None = None
    sign: float = 1.0
    ratio: float = 1.0
    hold: Literal["mean", "last"] = "mean"
    reduce: Literal["mean", "sum"] = "mean"
    smooth: int = 1
    heading: bool = False
    width: float = WIDTH
    lever: float = 0.0
    axis: int | None = None

    @property
    def result(self) -> str:
        """The name of what it becomes: a side slip becomes v_y."""
        return "v_y" if self.name == "side_slip" else self.name


@dataclass(frozen=True)
class Condition:
    """Rows are kept where ``signal`` compares so with ``value`` in SI; ``unit``: of the map, "" for SI."""

    signal: str
    comparison: Literal[">", ">=", "<", "<="]
    value: float
    unit: str = ""


@dataclass(frozen=True)
class LogMap:
    """A map: sources, states and inputs in order, and the grid that they are brought onto.

    ``dt`` in s, None for the step of the slowest state; ``gap`` and ``shortest`` in s; ``wheelbase`` in m; ``runs``:
    the pattern of the folders that hold a run each. States that are ``exogenous`` are inputs here, behind the others.
    """

    sources: tuple[Source, ...]
    states: tuple[Signal, ...]
    inputs: tuple[Signal, ...]
    dt: float | None = None
    gap: float = GAP
    shortest: float = SHORTEST
    keep: tuple[Condition, ...] = ()
    wheelbase: float | None = None
    exogenous: tuple[str, ...] = ()
    runs: str = ""

    @property
    def signals(self) -> tuple[Signal, ...]:
        """States and inputs."""
        return self.states + self.inputs

    @property
    def used(self) -> tuple[Source, ...]:
        """The sources that signals are taken from."""
        names = {signal.source for signal in self.signals}
        return tuple(source for source in self.sources if source.name in names)
