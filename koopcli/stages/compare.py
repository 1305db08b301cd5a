"""How far two records are apart: their arrays, in pieces that fit into memory, and their small facts."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from koopcli.blocks import Blocks
from koopcli.config.changes import flat
from koopcli.progress import Progress, silent
from koopcli.records import Array, Packed
from koopcli.store.identity import SLAB

WIDEST = 16  # bytes of the widest value


@dataclass(frozen=True)
class Difference:
    """One array of two records.

    ``layout``: what differs about it besides its values, in words; ``largest`` and ``relative``: of |a − b| and of that
    over max(|a|, |b|), None where values cannot be compared one by one; ``beyond`` of ``count`` values are further
    apart than the tolerance. Two values that are not numbers are equal; one and a number are infinitely far apart.
    """

    name: str
    shape: tuple[int, ...]
    layout: tuple[str, ...]
    largest: float | None
    relative: float | None
    beyond: int
    count: int

    @property
    def equal(self) -> bool:
        """Whether the arrays are the same within the tolerance."""
        return not self.layout and self.beyond == 0


@dataclass(frozen=True)
class Comparison:
    """All arrays, and the small facts that differ: name -> (value of a, value of b), None where there is none."""

    arrays: tuple[Difference, ...]
    facts: dict[str, tuple[Any, Any]]

    @property
    def equal(self) -> bool:
        """Whether the two records are the same within the tolerance."""
        return not self.facts and all(array.equal for array in self.arrays)


def compare(a: Packed, b: Packed, rtol: float, progress: Progress = silent) -> Comparison:
    """Compare two records; a value counts as equal where |a − b| ≤ rtol · max(|a|, |b|)."""
    names = sorted(a.arrays.keys() | b.arrays.keys())
    arrays = []
    for i, name in enumerate(names):
        arrays.append(_array(name, a.arrays.get(name), b.arrays.get(name), rtol))
        progress(i + 1, len(names))
    return Comparison(tuple(arrays), differing(a.meta, b.meta, rtol))


def differing(a: Mapping[str, Any], b: Mapping[str, Any], rtol: float = 0.0) -> dict[str, tuple[Any, Any]]:
    """The nested facts that differ, by their full names; numbers only where they differ by more than ``rtol``."""
    flat_a, flat_b = dict(flat(a)), dict(flat(b))
    names = sorted(flat_a.keys() | flat_b.keys())
    return {
        name: (flat_a.get(name), flat_b.get(name))
        for name in names
        if not (name in flat_a and name in flat_b and _close(flat_a[name], flat_b[name], rtol))
    }


def _array(name: str, a: Array | None, b: Array | None, rtol: float) -> Difference:
    if a is None or b is None:
        array = a or b
        assert array is not None, "the name is of one of them"
        shape, count = _shape(array.values)
        return Difference(name, shape, (f"only in {'A' if b is None else 'B'}",), None, None, count, count)
    shape, count = _shape(a.values)
    layout = [
        f"{what} {_words(left)} | {_words(right)}"
        for what, left, right in (
            ("shape", shape, _shape(b.values)[0]),
            ("type", np.dtype(a.values.dtype).newbyteorder("="), np.dtype(b.values.dtype).newbyteorder("=")),
            ("units", a.units, b.units),
            ("axes", a.axes, b.axes),
        )
        if left != right
    ]
    if shape != _shape(b.values)[0]:
        return Difference(name, shape, tuple(layout), None, None, count, count)
    largest = relative = 0.0
    beyond = 0
    for rows in _rows(shape):
        apart, share = _apart(np.asarray(a.values[rows]), np.asarray(b.values[rows]))
        if apart.size:
            largest, relative = max(largest, float(apart.max())), max(relative, float(share.max()))
            beyond += int(np.count_nonzero(share > rtol))
    return Difference(name, shape, tuple(layout), largest, relative, beyond, count)


def _apart(a: Any, b: Any) -> tuple[Any, Any]:
    """|a − b| and its share of max(|a|, |b|), elementwise."""
    if a.dtype.kind not in "biufc" or b.dtype.kind not in "biufc":
        unequal = np.where(a == b, 0.0, np.inf)
        return unequal, unequal
    wide = [values if values.dtype.kind == "c" else values.astype(np.longdouble) for values in (a, b)]
    with np.errstate(all="ignore"):
        missing = [np.isnan(values) for values in wide]
        same = (wide[0] == wide[1]) | (missing[0] & missing[1])
        apart = np.where(same, 0.0, np.abs(wide[0] - wide[1]))
        apart = np.where(np.isnan(apart), np.inf, apart)
        size = np.maximum(*(np.where(lost, 0.0, np.abs(values)) for lost, values in zip(missing, wide, strict=True)))
        share = np.where(np.isinf(apart), np.inf, apart / np.where(size > 0, size, 1.0))
    return apart, share


def _rows(shape: tuple[int, ...]) -> Iterator[Any]:
    """Slices of the first axis of about ``SLAB`` bytes of the widest values."""
    if not shape:
        yield ()
        return
    step = max(1, SLAB // max(1, WIDEST * math.prod(shape[1:])))
    for start in range(0, shape[0], step):
        yield slice(start, start + step)


def _shape(values: Blocks) -> tuple[tuple[int, ...], int]:
    shape = tuple(int(length) for length in values.shape)
    return shape, math.prod(shape)


def _close(a: Any, b: Any, rtol: float) -> bool:
    if isinstance(a, (list, tuple)) and isinstance(b, (list, tuple)):
        return len(a) == len(b) and all(_close(x, y, rtol) for x, y in zip(a, b, strict=True))
    if any(isinstance(x, bool) or not isinstance(x, (int, float)) for x in (a, b)):
        return json.dumps(a, sort_keys=True) == json.dumps(b, sort_keys=True)
    if not (math.isfinite(a) and math.isfinite(b)):
        return a == b or (math.isnan(a) and math.isnan(b))
    return bool(abs(a - b) <= rtol * max(abs(a), abs(b)))


def _words(value: Any) -> str:
    return " × ".join(map(str, value)) if isinstance(value, tuple) and value else str(value)
