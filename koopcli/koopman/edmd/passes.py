"""Passes over the data: what each makes of some of the samples, and how the whole is put together from that.

A pass runs here over all samples, or wherever its caller spreads it, some of the samples at a time; what the parts give
is merged in their order, so that who computed them moves no bit.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Protocol

import numpy as np

from koopcli.koopman.edmd.transitions import Transitions
from koopcli.progress import Progress, silent
from koopcli.records import Array, Packed

Found = dict[str, np.ndarray]


class Pass(Protocol):
    """Work on samples that do not depend on one another."""

    def __call__(self, data: Transitions, span: slice, progress: Progress) -> Found:
        """What the samples of ``span`` give."""

    @property
    def bytes(self) -> float:
        """About how many bytes a part gives."""

    def pack(self) -> Packed:
        """The pass for another process, with its ``kind``."""


Over = Callable[[Pass], Iterable[Found]]
"""Runs a pass over all samples; yields what consecutive parts of them give, in their order."""


def here(data: Transitions, progress: Progress = silent) -> Over:
    """In this process, all samples as one part."""
    return lambda work: [work(data, slice(0, len(data)), progress)]


def pack_found(results: Found) -> Packed:
    """What a part gave, for storage."""
    return Packed(
        {name: Array(values, tuple(f"{name}_{i}" for i in range(values.ndim)), "1") for name, values in results.items()}
    )


def unpack_found(packed: Packed) -> Found:
    """The inverse of :func:`pack_found`."""
    return {name: np.asarray(array.values[...]) for name, array in packed.arrays.items()}
