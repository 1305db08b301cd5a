"""What records hold decides whether they are equal, and a few words of it show them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from koopcli.blocks import blocks

READ = 1 << 20  # values compared together
SHOWN = 40  # letters of a value


class Content:
    """Base of records with arrays: equal where names, units, values and all else are, and shown without the values.

    Not a number equals itself here. Arrays can change, so a record is no key of a dictionary, as an array is none.
    Declare those records with ``eq=False, repr=False``, or the dataclass brings methods of its own.
    """

    __hash__ = None  # type: ignore[assignment]  # as Python itself marks what cannot be hashed

    def __eq__(self, other: object) -> bool:
        return alike(self, other) if type(self) is type(other) else NotImplemented

    def __repr__(self) -> str:
        held = (f"{f.name}={shown(getattr(self, f.name))}" for f in fields(self))  # type: ignore[arg-type]
        return f"{type(self).__name__}({', '.join(held)})"


def alike(a: Any, b: Any) -> bool:
    """Whether two values hold the same, arrays in memory or on disk by their values."""
    if _is_array(a) or _is_array(b):
        return _is_array(a) and _is_array(b) and _same_values(a, b)
    if is_dataclass(a) and not isinstance(a, type):
        return type(a) is type(b) and all(alike(getattr(a, f.name), getattr(b, f.name)) for f in fields(a))
    if isinstance(a, Mapping):
        return isinstance(b, Mapping) and a.keys() == b.keys() and all(alike(a[key], b[key]) for key in a)
    if isinstance(a, (list, tuple)):
        return type(a) is type(b) and len(a) == len(b) and all(map(alike, a, b))
    if isinstance(a, float) and isinstance(b, float) and math.isnan(a):
        return math.isnan(b)
    return bool(a == b)


def shown(value: Any) -> str:
    """A value in a few letters: an array by its shape, a record by its kind, facts by their number."""
    if _is_array(value):
        return f"array {' × '.join(map(str, value.shape))}"
    if isinstance(value, Content):
        return f"{type(value).__name__}(…)"
    if isinstance(value, Mapping):
        return f"{{{len(value)} facts}}"
    if isinstance(value, (list, tuple)) and any(_is_array(item) or isinstance(item, Content) for item in value):
        return f"({', '.join(map(shown, value))})"
    text = repr(value)
    return text if len(text) <= SHOWN else f"{text[: SHOWN - 1]}…"


def _is_array(value: Any) -> bool:
    """Whether ``value`` is an array, in memory, on disk, or put together; a number of numpy is none."""
    return hasattr(value, "shape") and hasattr(value, "dtype") and value.shape != ()


def _same_values(a: Any, b: Any) -> bool:
    if a.shape != b.shape:
        return False
    rows = max(1, READ * a.shape[0] // max(1, int(np.prod(a.shape, dtype=np.int64))))
    return all(_equal(np.asarray(a[part]), np.asarray(b[part])) for part in blocks(slice(0, a.shape[0]), rows))


def _equal(a: np.ndarray, b: np.ndarray) -> bool:
    numbers = all(values.dtype.kind in "fc" for values in (a, b))
    return bool(np.array_equal(a, b, equal_nan=numbers))
