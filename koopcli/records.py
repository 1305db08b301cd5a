"""The records that carry data between stages: arrays with named axes and units, and nothing about files."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from koopcli.blocks import Blocks, Chosen, Joined
from koopcli.content import Content
from koopcli.errors import InvalidValueError

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
IntArray = npt.NDArray[np.int64]
IndexArray = npt.NDArray[np.intp]
Meta = dict[str, Any]  # what JSON can hold
CHANNELS = ("state", "input", "constant_and_input")  # axes whose entries may have units of their own
OF_STATES = "of states"  # the units of what does not know its states, until it is packed with what does


@dataclass(frozen=True, eq=False, repr=False)
class Array(Content):
    """Values with a name for every axis, such as ``training_state``, and their unit.

    ``units`` may list several, separated by commas: one for each entry of the one axis that is among ``CHANNELS``.
    Within a group of a file an axis of one name has one length.
    """

    values: Blocks
    axes: tuple[str, ...]
    units: str


@dataclass(frozen=True, eq=False, repr=False)
class Packed(Content):
    """A record taken apart for storage: named arrays, and small facts as JSON."""

    arrays: Mapping[str, Array]
    meta: Meta = field(default_factory=dict)

    def below(self, prefix: str) -> dict[str, Array]:
        """The arrays whose names begin with ``prefix``, without it."""
        return {name.removeprefix(prefix): array for name, array in self.arrays.items() if name.startswith(prefix)}


@dataclass(frozen=True)
class Channels:
    """Names and units of the components of a state or input vector."""

    names: tuple[str, ...]
    units: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.names)

    @property
    def unit_text(self) -> str:
        """The units as one text, for a stored array."""
        return ", ".join(self.units)

    def __str__(self) -> str:
        return ", ".join(f"{name} ({unit})" for name, unit in zip(self.names, self.units, strict=True))

    def pack(self) -> Meta:
        """The channels as JSON."""
        return {"names": list(self.names), "units": list(self.units)}

    @classmethod
    def unpack(cls, meta: Mapping[str, list[str]]) -> Channels:
        """The inverse of :meth:`pack`."""
        return cls(tuple(meta["names"]), tuple(meta["units"]))


@dataclass(frozen=True, eq=False, repr=False)
class Sample(Content):
    """Initial states and inputs.

    ``factors``: per state the values of a grid, or empty; then ``states`` (n, n_x) holds the initial states.
    ``inputs`` (rows, held steps, n_u) in the units of their channels. ``crossed``: every state meets every input row;
    otherwise row i goes with state i. A single input step is held over the whole trajectory.
    """

    factors: tuple[FloatArray, ...]
    states: FloatArray
    inputs: FloatArray
    crossed: bool
    state_channels: Channels
    input_channels: Channels

    def __repr__(self) -> str:
        rows = f" × {len(self.inputs)} rows of inputs" if self.crossed else ""
        return f"Sample: {self.starts} states{rows}\n{_channels(self)}"

    @property
    def x0(self) -> FloatArray:
        """Initial states (n, n_x); a grid runs with its last factor fastest."""
        if not self.factors:
            return self.states
        return np.stack(np.meshgrid(*self.factors, indexing="ij"), axis=-1).reshape(-1, len(self.factors))

    @property
    def starts(self) -> int:
        """Number of initial states."""
        return math.prod(len(factor) for factor in self.factors) if self.factors else len(self.states)

    @property
    def product(self) -> tuple[int, int] | None:
        """(states, input rows) if every state meets every input row."""
        return (self.starts, len(self.inputs)) if self.crossed else None

    @property
    def trajectories(self) -> int:
        """Number of trajectories."""
        return self.starts * len(self.inputs) if self.crossed else self.starts

    def expand(self, steps: int, rows: slice = slice(None)) -> tuple[FloatArray, FloatArray]:
        """Initial states (n, n_x) and inputs (n, steps, n_u) of each trajectory, state-major when crossed.

        ``rows``: of these trajectories only.
        """
        x0, u = self.x0, self.inputs
        if 1 < u.shape[1] < steps:
            raise InvalidValueError(
                f"the sample holds inputs for {u.shape[1]} steps, {steps} were asked for: sample again with more"
            )
        if self.crossed:
            chosen = np.arange(*rows.indices(self.trajectories))
            x0, u = x0[chosen // len(u)], u[chosen % len(u)]
        else:
            x0, u = x0[rows], u[rows]
        return x0, np.repeat(u, steps, axis=1) if u.shape[1] == 1 else u[:, :steps]

    def pack(self) -> Packed:
        """The sample for storage; a grid is stored by its factors."""
        units = self.state_channels.units
        arrays = {
            f"factors/{name}": Array(values, (name,), unit)
            for name, unit, values in zip(self.state_channels.names, units, self.factors, strict=False)
        }
        if not self.factors:
            arrays["states"] = Array(self.states, ("trajectory", "state"), self.state_channels.unit_text)
        arrays["inputs"] = Array(self.inputs, ("input_row", "step", "input"), self.input_channels.unit_text)
        meta = {
            "crossed": self.crossed,
            "state_channels": self.state_channels.pack(),
            "input_channels": self.input_channels.pack(),
        }
        return Packed(arrays, meta)

    @classmethod
    def unpack(cls, packed: Packed) -> Sample:
        """The inverse of :meth:`pack`."""
        channels = Channels.unpack(packed.meta["state_channels"])
        values = {name: array.values[...] for name, array in packed.arrays.items()}
        factors = tuple(values[f"factors/{n}"] for n in channels.names if f"factors/{n}" in values)
        return cls(
            factors=factors,
            states=values.get("states", np.empty((0, len(channels)))),
            inputs=values["inputs"],
            crossed=packed.meta["crossed"],
            state_channels=channels,
            input_channels=Channels.unpack(packed.meta["input_channels"]),
        )


@dataclass(frozen=True, eq=False, repr=False)
class Course(Content):
    """How the integration of n trajectories went.

    ``steps`` (n,): the last sample that each has a state at; ``reason`` (n,): why it ended there, a place in ``ENDS``,
    zero for one that ran its whole length; ``substeps`` (n,): the most integration steps that any of its samples took,
    zero where a solver chose them itself.
    """

    steps: IntArray
    reason: IntArray
    substeps: IntArray

    @property
    def finished(self) -> BoolArray:
        """Which ran their whole length, (n,)."""
        return np.asarray(self.reason == 0)

    def pack(self) -> dict[str, Array]:
        """The arrays for storage."""
        arrays = {f.name: Array(getattr(self, f.name), ("trajectory",), "1") for f in fields(self)}
        return {f"course/{name}": array for name, array in arrays.items()}

    @classmethod
    def unpack(cls, arrays: Mapping[str, Array]) -> Course | None:
        """The inverse of :meth:`pack`; None where there is none."""
        values = {name.partition("/")[2]: a.values[...] for name, a in arrays.items() if name.startswith("course/")}
        return cls(**values) if values else None


ENDS = (
    "ran its whole length",
    "left the numbers that mean anything",
    "needed too many integration steps for one sample",
    "stopped its solver",
)  # why trajectories end


@dataclass(frozen=True, eq=False, repr=False)
class Trajectories(Content):
    """Sampled trajectories: ``x`` (n, steps+1, n_x), ``u`` (n, steps, n_u) with u_k acting from k to k+1, ``dt`` in s.

    ``product = (states, input rows)`` says that the trajectories are every state with every input row, state-major.
    ``plant`` tells how they were made, as JSON, and ``course`` how it went; a trajectory that ended early is not a
    number from there on, and :meth:`finished` leaves it out. The arrays may live on disk; they are read in blocks.
    """

    x: Blocks
    u: Blocks
    dt: float
    state_channels: Channels
    input_channels: Channels
    product: tuple[int, int] | None = None
    plant: Meta = field(default_factory=dict)
    course: Course | None = None

    def __post_init__(self) -> None:
        n, samples, n_x = self.x.shape
        if self.u.shape[:2] != (n, samples - 1) or n_x != len(self.state_channels):
            raise InvalidValueError(f"trajectories of shape x {self.x.shape}, u {self.u.shape} do not fit together")
        if self.product is not None and self.product[0] * self.product[1] != n:
            raise InvalidValueError(f"{n} trajectories are not a product of {self.product[0]} × {self.product[1]}")

    def __len__(self) -> int:
        return self.x.shape[0]

    def __repr__(self) -> str:
        early = 0 if self.course is None else int((~self.course.finished).sum())
        ended = f", {early} of them ended early" if early else ""
        return f"Trajectories: {len(self)} × {self.steps} steps of {self.dt:g} s{ended}\n{_channels(self)}"

    @property
    def steps(self) -> int:
        """Steps of each trajectory."""
        return self.x.shape[1] - 1

    def finished(self) -> Trajectories:
        """Those that ran their whole length; the product structure is lost with any that did not."""
        return self._finished

    @cached_property
    def _finished(self) -> Trajectories:
        if self.course is None or self.course.finished.all():
            return self
        kept = self.course.finished
        course = Course(*(getattr(self.course, f.name)[kept] for f in fields(Course)))
        return replace(self, x=_rows(self.x, kept), u=_rows(self.u, kept), product=None, course=course)

    @property
    def factors(self) -> tuple[int, int] | None:
        """``product``, where every trajectory is one step and its structure carries over to the transitions."""
        return self.product if self.steps == 1 else None

    def pack(self) -> Packed:
        """The trajectories for storage."""
        arrays = {
            "x": Array(self.x, ("trajectory", "sample", "state"), self.state_channels.unit_text),
            "u": Array(self.u, ("trajectory", "step", "input"), self.input_channels.unit_text),
            **(self.course.pack() if self.course is not None else {}),
        }
        meta = {
            "dt": self.dt,
            "product": list(self.product) if self.product else None,
            "plant": self.plant,
            "state_channels": self.state_channels.pack(),
            "input_channels": self.input_channels.pack(),
        }
        return Packed(arrays, meta)

    @classmethod
    def unpack(cls, packed: Packed) -> Trajectories:
        """The inverse of :meth:`pack`; ``x`` and ``u`` stay where they are."""
        product = packed.meta["product"]
        return cls(
            x=packed.arrays["x"].values,
            u=packed.arrays["u"].values,
            dt=packed.meta["dt"],
            state_channels=Channels.unpack(packed.meta["state_channels"]),
            input_channels=Channels.unpack(packed.meta["input_channels"]),
            product=(product[0], product[1]) if product else None,
            plant=packed.meta["plant"],
            course=Course.unpack(packed.arrays),
        )


@dataclass(frozen=True, eq=False, repr=False)
class Episodes(Content):
    """What was measured, on one grid: ``x`` (rows, n_x) and ``u`` (rows, n_u) every ``dt`` s, episode after episode.

    ``bounds`` (episodes + 1,): the row that each episode begins at, and where the last one ends; ``starts``
    (episodes,): the time in s of its first row; ``runs`` (episodes,): which recording it is from. u_k acts from row k
    to k + 1; that of the last row of an episode acts beyond it.
    """

    x: Blocks
    u: Blocks
    dt: float
    bounds: IntArray
    starts: FloatArray
    runs: IntArray
    state_channels: Channels
    input_channels: Channels

    def __post_init__(self) -> None:
        lengths = np.diff(self.bounds)
        fits = self.bounds[0] == 0 and self.bounds[-1] == self.x.shape[0] == self.u.shape[0] and (lengths >= 2).all()
        if not fits or len(self.starts) != len(lengths) or len(self.runs) != len(lengths):
            raise InvalidValueError(f"episodes of x {self.x.shape} and u {self.u.shape} do not fit their bounds")

    def __len__(self) -> int:
        return len(self.starts)

    def __repr__(self) -> str:
        return f"Episodes: {len(self)}, {self.x.shape[0]} rows every {self.dt:g} s\n{_channels(self)}"

    @property
    def rows(self) -> int:
        """Rows of all episodes."""
        return int(self.x.shape[0])

    @property
    def lengths(self) -> IntArray:
        """Rows of each episode, (episodes,)."""
        return np.diff(self.bounds)

    @property
    def time(self) -> FloatArray:
        """The time in s of every row, (rows,)."""
        within = np.arange(self.rows) - np.repeat(self.bounds[:-1], self.lengths)
        return np.repeat(self.starts, self.lengths) + self.dt * within

    def pack(self) -> Packed:
        """The episodes for storage."""
        arrays = {
            "x": Array(self.x, ("row", "state"), self.state_channels.unit_text),
            "u": Array(self.u, ("row", "input"), self.input_channels.unit_text),
            "bounds": Array(self.bounds, ("bound",), "1"),
            "starts": Array(self.starts, ("episode",), "s"),
            "runs": Array(self.runs, ("episode",), "1"),
        }
        meta = {
            "dt": self.dt,
            "state_channels": self.state_channels.pack(),
            "input_channels": self.input_channels.pack(),
        }
        return Packed(arrays, meta)

    @classmethod
    def unpack(cls, packed: Packed) -> Episodes:
        """The inverse of :meth:`pack`; ``x`` and ``u`` stay where they are."""
        small = {name: packed.arrays[name].values[...] for name in ("bounds", "starts", "runs")}
        return cls(
            x=packed.arrays["x"].values,
            u=packed.arrays["u"].values,
            dt=packed.meta["dt"],
            state_channels=Channels.unpack(packed.meta["state_channels"]),
            input_channels=Channels.unpack(packed.meta["input_channels"]),
            **small,
        )


def _channels(record: Sample | Trajectories | Episodes) -> str:
    return f"  states {record.state_channels}\n  inputs {record.input_channels}"


def _rows(values: Blocks, kept: BoolArray) -> Blocks:
    """The rows of ``values`` that are ``kept``; those on disk stay there."""
    return values[kept] if isinstance(values, np.ndarray) else Chosen(values, np.flatnonzero(kept))


def join(parts: Sequence[Trajectories]) -> Trajectories:
    """One record from those of consecutive trajectories; what is on disk stays there."""
    if len(parts) == 1:
        return parts[0]
    courses = [part.course for part in parts if part.course is not None]
    course = Course(*(np.concatenate([getattr(part, f.name) for part in courses]) for f in fields(Course)))
    return replace(parts[0], x=Joined([p.x for p in parts]), u=Joined([p.u for p in parts]), course=course)
