"""MDF, by asammdf: each channel has its own time stamps, and none is put onto the raster of another."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.logs.entries import Source
from koopcli.logs.formats.table import Table, extra
from koopcli.records import FloatArray


def open_table(path: Path, source: Source) -> Table:
    """The table of the channels of an MDF file, each of numbers or of a conversion to numbers."""
    asammdf = extra("asammdf", "mdf", path)
    try:
        file = asammdf.MDF(path)
    except Exception as error:
        raise InvalidValueError(f"{path} cannot be read as MDF: {' '.join(str(error).split())}") from error
    places = [
        (group, channel)
        for group, content in enumerate(file.groups)
        for channel in range(len(content.channels))
        if channel != file.masters_db.get(group)
    ]
    channels = [file.groups[group].channels[channel] for group, channel in places]
    if not places:
        raise InvalidValueError(f"{path} holds no channel: decode its CAN frames with a DBC first")

    @lru_cache(maxsize=1)
    def fetch(place: int) -> tuple[FloatArray, FloatArray]:
        group, channel = places[place]
        signal = file.get(group=group, index=channel)
        if signal.samples.dtype.kind not in "fiub" or signal.samples.ndim != 1:
            raise InvalidValueError(
                f"{path}, channel '{channels[place].name}' holds no numbers: map another, or decode CAN by a DBC first"
            )
        return np.asarray(signal.timestamps, dtype=np.float64), signal.samples.astype(np.float64)

    def read(asked: Sequence[int]) -> list[FloatArray]:
        return [fetch(place)[1] for place in asked]

    names = tuple(str(channel.name) for channel in channels)
    units = tuple(str(getattr(channel, "unit", "") or "") for channel in channels)
    return Table(path, names, units, read, stamps=lambda place: fetch(place)[0], ordered=False)
