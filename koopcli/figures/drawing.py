"""A drawn figure: its numbers and its image, with the same bytes for the same numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from koopcli.records import Array, FloatArray, Packed


@dataclass(frozen=True)
class Drawing:
    """``numbers``: what is drawn, by column; ``image``: the rendered file of ``format``."""

    figure: str
    format: str
    numbers: Mapping[str, Array]
    image: bytes

    def pack(self) -> Packed:
        """The drawing for storage."""
        image = Array(np.frombuffer(self.image, dtype=np.uint8), ("byte",), "1")
        arrays = {"image": image, **{f"numbers/{name}": a for name, a in self.numbers.items()}}
        return Packed(arrays, {"figure": self.figure, "format": self.format})

    @classmethod
    def unpack(cls, packed: Packed) -> Drawing:
        """The inverse of :meth:`pack`."""
        numbers = {
            name.removeprefix("numbers/"): Array(a.values[...], a.axes, a.units)
            for name, a in packed.arrays.items()
            if name.startswith("numbers/")
        }
        return cls(
            packed.meta["figure"],
            packed.meta["format"],
            numbers,
            packed.arrays["image"].values[...].tobytes(),
        )


def column(values: FloatArray, axis: str, unit: str) -> Array:
    """One drawn column."""
    return Array(values, (axis,), unit)
