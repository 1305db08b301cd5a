"""One-step pairs of one or several records of trajectories or episodes, numbered through and read in blocks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.koopman.predictor.coverage import HULL_STATES, MEASURED_STATES
from koopcli.records import Channels, Episodes, FloatArray, IntArray, Meta, Trajectories

Pairs = tuple[FloatArray, FloatArray, FloatArray]  # x (n, n_x), u (n, n_u), x⁺ (n, n_x)
Record = Trajectories | Episodes


class Windows(NamedTuple):
    """Pairs with their past: ``x`` (n, n_x), ``u`` (n, n_u), the next state ``x_next`` (n, n_x), and the ``past_x``
    (n, p, n_x) and ``past_u`` (n, p, n_u) of the p steps before, newest first.
    """

    x: FloatArray
    u: FloatArray
    x_next: FloatArray
    past_x: FloatArray
    past_u: FloatArray


@dataclass(frozen=True)
class Transitions:
    """The pairs (x, u, x⁺) of ``records``, which have the same states, inputs, sampling period and plant."""

    records: tuple[Record, ...]

    def __post_init__(self) -> None:
        first = self.records[0]
        for record in self.records[1:]:
            for name in ("state_channels", "input_channels", "dt", "plant"):
                if getattr(record, name, {}) != getattr(first, name, {}):
                    raise InvalidValueError(f"these trajectories differ in their {_WORDS[name]}: fit them apart")

    @classmethod
    def of(cls, data: Record | Sequence[Record] | Transitions) -> Transitions:
        """The transitions of a record, or of several."""
        if isinstance(data, Transitions):
            return data
        return cls((data,) if isinstance(data, (Trajectories, Episodes)) else tuple(data))

    def __len__(self) -> int:
        return self.count(0)

    def count(self, memory: int) -> int:
        """How many pairs have ``memory`` steps before them."""
        return sum(_count(record, memory) for record in self.records)

    @property
    def longest(self) -> int:
        """Rows of the longest trajectory or episode."""
        return max(_longest(record) for record in self.records)

    @property
    def hull_states(self) -> int:
        """The most states whose hull is found."""
        return MEASURED_STATES if any(isinstance(record, Episodes) for record in self.records) else HULL_STATES

    @property
    def state_channels(self) -> Channels:
        """Names and units of the state."""
        return self.records[0].state_channels

    @property
    def input_channels(self) -> Channels:
        """Names and units of the input."""
        return self.records[0].input_channels

    @property
    def dt(self) -> float:
        """The sampling period in s."""
        return self.records[0].dt

    @property
    def plant(self) -> Meta:
        """How they were made, as JSON; empty where they were measured."""
        first = self.records[0]
        return {} if isinstance(first, Episodes) else first.plant

    @property
    def product(self) -> Trajectories | None:
        """The one record whose pairs are every state with every input, if that is what they are."""
        first = self.records[0]
        alone = len(self.records) == 1 and not isinstance(first, Episodes) and first.factors is not None
        return first if alone and not isinstance(first, Episodes) else None

    def blocks(self, rows: int, span: slice | None = None) -> Iterator[Pairs]:
        """Pairs in blocks of at most ``rows``, those of ``span`` (a slice with both ends) only.

        No pair spans two trajectories or episodes, nor a block two records.
        """
        for block in self.windows(0, rows, span):
            yield block.x, block.u, block.x_next

    def windows(self, memory: int, rows: int, span: slice | None = None) -> Iterator[Windows]:
        """As :meth:`blocks`, with the past ``memory`` steps of each pair; a pair without so many before it is left out.

        ``span`` counts the pairs that are left.
        """
        start, stop = (0, self.count(memory)) if span is None else (span.start, span.stop)
        before = 0
        for record in self.records:
            count = _count(record, memory)
            first, last = max(start - before, 0), min(stop - before, count)
            if isinstance(record, Episodes):
                yield from _of_episodes(record, memory, rows, first, last)
            else:
                yield from _of_trajectories(record, memory, rows, first, last)
            before += count


def _count(record: Record, memory: int) -> int:
    if isinstance(record, Episodes):
        return int(_usable(record, memory).sum())
    return len(record) * max(0, record.steps - memory)


def _longest(record: Record) -> int:
    return int(record.lengths.max()) if isinstance(record, Episodes) else record.steps + 1


def _usable(record: Episodes, memory: int) -> IntArray:
    """Pairs with so many steps before them in each episode, (episodes,)."""
    return np.maximum(record.lengths - 1 - memory, 0)


def _of_trajectories(record: Trajectories, memory: int, rows: int, start: int, stop: int) -> Iterator[Windows]:
    n_x, n_u, steps = record.x.shape[2], record.u.shape[2], record.steps - memory
    while start < stop:
        i, k = divmod(start, steps)
        whole = min(rows, stop - start) // steps if k == 0 else 0
        length = steps if whole else min(rows, stop - start, steps - k)
        chosen = slice(i, i + max(whole, 1))
        x, u = record.x[chosen, k : k + memory + length + 1], record.u[chosen, k : k + memory + length]
        past = np.arange(memory, memory + length)
        yield Windows(
            x[:, memory:-1].reshape(-1, n_x),
            u[:, memory:].reshape(-1, n_u),
            x[:, memory + 1 :].reshape(-1, n_x),
            _past(x, past, memory),
            _past(u, past, memory),
        )
        start += max(whole, 1) * length


def _of_episodes(record: Episodes, memory: int, rows: int, start: int, stop: int) -> Iterator[Windows]:
    """The pairs within as many consecutive rows at a time, so that short episodes are read together."""
    usable = _usable(record, memory)
    ends = np.cumsum(usable)
    begins = record.bounds[:-1] + memory - (ends - usable)  # of a pair's number in its episode, the row of the pair
    while start < stop:
        number = np.arange(start, min(start + rows, stop))
        row = number + begins[np.searchsorted(ends, number, side="right")]
        row = row[row < row[0] + rows]
        first = int(row[0]) - memory
        read = slice(first, int(row[-1]) + 2)
        x, u, row = np.asarray(record.x[read]), np.asarray(record.u[read]), row - first
        yield Windows(x[row], u[row], x[row + 1], _past(x[np.newaxis], row, memory), _past(u[np.newaxis], row, memory))
        start += len(row)


def _past(values: FloatArray, rows: IntArray, memory: int) -> FloatArray:
    """The ``memory`` values before each of the ``rows`` (m,) of ``values`` (n, rows, k), newest first, (n m, p, k)."""
    n, _, k = values.shape
    if not memory:
        return np.empty((n * len(rows), 0, k))
    return np.stack([values[:, rows - j].reshape(n * len(rows), k) for j in range(1, memory + 1)], axis=1)


_WORDS = {
    "state_channels": "states",
    "input_channels": "inputs",
    "dt": "sampling period",
    "plant": "vehicle or plant",
}
