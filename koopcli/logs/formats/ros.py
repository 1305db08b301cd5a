"""Bags of ROS 1 and 2, by rosbags: every number of a message is a column "topic/field", with the time of its topic."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.logs.entries import Source
from koopcli.logs.formats.table import Table, extra
from koopcli.records import FloatArray

LONGEST = 64  # numbers of one array in a message


def open_table(path: Path, source: Source) -> Table:
    """The table of a bag. Its time is that of the header of a message, or of its receipt where it has none."""
    reader = extra("rosbags.highlevel", "ros", path).AnyReader
    bag = path.parent if path.suffix in (".db3", ".mcap") and (path.parent / "metadata.yaml").exists() else path
    columns: dict[str, list[float]] = {}
    stamps: dict[str, list[float]] = {}
    try:
        with reader([bag]) as content:
            for connection, received, raw in content.messages():
                message = content.deserialize(raw, connection.msgtype)
                stamps.setdefault(connection.topic, []).append(_stamp(message, received))
                rows = len(stamps[connection.topic])
                for name, value in _leaves(message, connection.topic):
                    values = columns.setdefault(name, [])
                    values += [np.nan] * (rows - 1 - len(values)) + [value]
    except Exception as error:
        raise InvalidValueError(f"{path} cannot be read as a bag of ROS: {' '.join(str(error).split())}") from error
    if not columns:
        raise InvalidValueError(f"{path} holds no message with numbers")
    names = tuple(columns)
    topics = {name: max((t for t in stamps if name.startswith(f"{t}/")), key=len) for name in names}

    def read(places: Sequence[int]) -> list[FloatArray]:
        values = [columns[names[place]] for place in places]
        lengths = [len(stamps[topics[names[place]]]) for place in places]
        return [np.array(v + [np.nan] * (n - len(v))) for v, n in zip(values, lengths, strict=True)]

    def stamped(place: int) -> FloatArray:
        return np.array(stamps[topics[names[place]]])

    return Table(path, names, ("",) * len(names), read, stamps=stamped, ordered=False)


def _stamp(message: Any, received: int) -> float:
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    if stamp is not None and stamp.sec:
        return float(stamp.sec + 1e-9 * stamp.nanosec)
    return received * 1e-9


def _leaves(value: Any, name: str) -> Iterator[tuple[str, float]]:
    if is_dataclass(value):
        for f in fields(value):
            if not f.name.startswith("__"):
                yield from _leaves(getattr(value, f.name), f"{name}/{f.name}")
    elif isinstance(value, (int, float, np.integer, np.floating)):
        yield name, float(value)
    elif isinstance(value, np.ndarray) and value.ndim == 1 and len(value) <= LONGEST and value.dtype.kind in "fiub":
        for place, entry in enumerate(value):
            yield f"{name}/{place}", float(entry)
