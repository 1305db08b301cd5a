"""One-step pairs of one or several records of trajectories, numbered through and read in blocks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from koopcli.errors import InvalidValueError
from koopcli.records import Channels, FloatArray, Meta, Trajectories

Pairs = tuple[FloatArray, FloatArray, FloatArray]  # x (n, n_x), u (n, n_u), x⁺ (n, n_x)


@dataclass(frozen=True)
class Transitions:
    """The pairs (x, u, x⁺) of ``records``, which have the same states, inputs, sampling period and plant."""

    records: tuple[Trajectories, ...]

    def __post_init__(self) -> None:
        first = self.records[0]
        for record in self.records[1:]:
            for name in ("state_channels", "input_channels", "dt", "plant"):
                if getattr(record, name) != getattr(first, name):
                    raise InvalidValueError(f"these trajectories differ in their {_WORDS[name]}: fit them apart")

    @classmethod
    def of(cls, data: Trajectories | Sequence[Trajectories] | Transitions) -> Transitions:
        """The transitions of a record, or of several."""
        if isinstance(data, Transitions):
            return data
        return cls((data,) if isinstance(data, Trajectories) else tuple(data))

    def __len__(self) -> int:
        return sum(len(record) * record.steps for record in self.records)

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
        """How they were made, as JSON."""
        return self.records[0].plant

    @property
    def product(self) -> Trajectories | None:
        """The one record whose pairs are every state with every input, if that is what they are."""
        alone = len(self.records) == 1 and self.records[0].factors is not None
        return self.records[0] if alone else None

    def blocks(self, rows: int, span: slice | None = None) -> Iterator[Pairs]:
        """Pairs in blocks of at most ``rows``, those of ``span`` (a slice with both ends) only.

        No pair spans two trajectories, nor a block two records.
        """
        start, stop = (0, len(self)) if span is None else (span.start, span.stop)
        before = 0
        for record in self.records:
            count = len(record) * record.steps
            yield from _blocks(record, rows, max(start - before, 0), min(stop - before, count))
            before += count


def _blocks(record: Trajectories, rows: int, start: int, stop: int) -> Iterator[Pairs]:
    n_x, n_u, steps = record.x.shape[2], record.u.shape[2], record.steps
    while start < stop:
        i, k = divmod(start, steps)
        whole = min(rows, stop - start) // steps if k == 0 else 0
        length = steps if whole else min(rows, stop - start, steps - k)
        chosen = slice(i, i + max(whole, 1))
        x, u = record.x[chosen, k : k + length + 1], record.u[chosen, k : k + length]
        yield x[:, :-1].reshape(-1, n_x), u.reshape(-1, n_u), x[:, 1:].reshape(-1, n_x)
        start += max(whole, 1) * length


_WORDS = {
    "state_channels": "states",
    "input_channels": "inputs",
    "dt": "sampling period",
    "plant": "vehicle or plant",
}
