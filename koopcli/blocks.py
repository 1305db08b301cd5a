"""Arrays that are read by slices of their first axis: in memory, on disk, or put together from others."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from itertools import accumulate
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt


class Blocks(Protocol):
    """An array in memory or on disk that is read by slices of its first axis."""

    @property
    def shape(self) -> tuple[int, ...]:
        """The lengths of the axes."""

    @property
    def dtype(self) -> Any:
        """The numpy type."""

    def __getitem__(self, rows: Any, /) -> Any: ...


def blocks(rows: slice, size: int) -> Iterator[slice]:
    """``rows``, a slice with both ends, in slices of at most ``size``."""
    for start in range(rows.start, rows.stop, size):
        yield slice(start, min(start + size, rows.stop))


class Joined:
    """Arrays one after another along their first axis, read as one."""

    def __init__(self, parts: Sequence[Blocks]) -> None:
        self._parts = parts
        self._ends = list(accumulate(part.shape[0] for part in parts))
        self.shape = (self._ends[-1], *parts[0].shape[1:])
        self.dtype = parts[0].dtype

    def __getitem__(self, index: Any, /) -> Any:
        """The rows of a slice of step one, from the parts that hold them."""
        first, rest = _split(index)
        start, stop, _ = slice(first.start, first.stop).indices(self.shape[0])
        blocks = []
        i = bisect_right(self._ends, start)
        while start < stop:
            before = self._ends[i] - self._parts[i].shape[0]
            until = min(stop, self._ends[i])
            blocks.append(self._parts[i][(slice(start - before, until - before), *rest)])
            start, i = until, i + 1
        return np.concatenate(blocks) if blocks else np.asarray(self._parts[0][(slice(0, 0), *rest)])


class Chosen:
    """Rows of an array, in ascending order, read with no more of the others than lie between them."""

    def __init__(self, values: Blocks, rows: npt.NDArray[np.int64]) -> None:
        self._values, self._rows = values, rows
        self.shape = (len(rows), *values.shape[1:])
        self.dtype = values.dtype

    def __getitem__(self, index: Any, /) -> Any:
        """The rows of a slice, of an array of places, or of a place."""
        first, rest = _split(index)
        rows = self._rows[first]
        if np.size(rows) == 0:
            return np.asarray(self._values[(slice(0, 0), *rest)])
        low = int(np.min(rows))
        return np.asarray(self._values[(slice(low, int(np.max(rows)) + 1), *rest)])[rows - low]


def _split(index: Any) -> tuple[Any, tuple[Any, ...]]:
    """What an index says of the first axis, and of the others."""
    first, *rest = index if isinstance(index, tuple) else (index,)
    if first is Ellipsis and rest:
        raise IndexError("blocks are indexed from their first axis")
    return (slice(None) if first is Ellipsis else first), tuple(rest)
