"""Two hashes for two jobs: the key of a recipe, and the digest of what was made."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import is_dataclass
from typing import Any

import numpy as np

from koopcli.blocks import Blocks
from koopcli.choices import written
from koopcli.errors import InvalidValueError
from koopcli.records import Packed

SCHEMA = 2
SLAB = 1 << 24  # bytes hashed or written at a time


def plain(value: Any) -> Any:
    """Settings as JSON values that people can read; floats keep every digit."""
    if is_dataclass(value) and not isinstance(value, type):
        return plain(written(value))
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    return value


def canonical(value: Any) -> bytes:
    """The one JSON text of ``value``: sorted keys, floats by ``float.hex``, -0.0 as 0.0, nan and inf refused.

    >>> canonical({"b": 1.0, "a": 1})
    b'{"a":1,"b":"0x1.0000000000000p+0"}'
    """
    return json.dumps(_exact(plain(value)), sort_keys=True, separators=(",", ":"), ensure_ascii=False).encode()


def key_of(recipe: Mapping[str, Any]) -> str:
    """The key of a recipe {schema, stage, version, settings, inputs}, whose inputs are data digests."""
    return hashlib.sha256(canonical(recipe)).hexdigest()


def data_digest(packed: Packed) -> str:
    """Digest of the logical content: paths, types, shapes, units, axes, values in C order, and the small facts."""
    digest = hashlib.sha256()
    for path, array in sorted(packed.arrays.items()):
        dtype = np.dtype(array.values.dtype).newbyteorder("<")
        head = [path, dtype.str, list(array.values.shape), array.units, list(array.axes)]
        digest.update(canonical(head))
        for slab in slabs(array.values):
            digest.update(np.ascontiguousarray(slab, dtype=dtype).data)
    digest.update(canonical(packed.meta))
    return digest.hexdigest()


def slabs(values: Blocks) -> Iterator[Any]:
    """The array in slices of its first axis of about ``SLAB`` bytes."""
    rows = values.shape[0]
    row_bytes = int(np.prod(values.shape[1:], dtype=np.int64)) * np.dtype(values.dtype).itemsize
    step = max(1, SLAB // max(1, row_bytes))
    for start in range(0, rows, step):
        yield values[start : start + step]


def _exact(value: Any) -> Any:
    if isinstance(value, float):
        if not math.isfinite(value):
            raise InvalidValueError(f"a setting must be a finite number, got {value}")
        return (value + 0.0).hex()
    if isinstance(value, dict):
        return {k: _exact(v) for k, v in value.items()}
    if isinstance(value, list):
        return [_exact(v) for v in value]
    return value
