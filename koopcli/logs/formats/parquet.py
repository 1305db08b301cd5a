"""Parquet, by pyarrow."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.logs.entries import Source
from koopcli.logs.formats.table import Table, extra
from koopcli.logs.text import split_unit
from koopcli.records import FloatArray


def open_table(path: Path, source: Source) -> Table:
    """The table of a Parquet file; a column of times is in s."""
    parquet = extra("pyarrow.parquet", "parquet", path)
    arrow = extra("pyarrow", "parquet", path)
    try:
        file = parquet.ParquetFile(path)
    except arrow.ArrowException as error:
        raise InvalidValueError(f"{path} cannot be read as Parquet: {' '.join(str(error).split())}") from error
    titles = list(file.schema_arrow.names)

    def read(places: Sequence[int]) -> list[FloatArray]:
        content = file.read(columns=[titles[place] for place in places])
        return [_numbers(content.column(titles[place]).to_numpy(), path, titles[place]) for place in places]

    def words(place: int) -> list[str]:
        return [str(value) for value in file.read(columns=[titles[place]]).column(0).to_pylist()]

    names, units = zip(*(split_unit(title) for title in titles), strict=True)
    return Table(path, names, units, read, words)


def _numbers(values: np.ndarray, path: Path, title: str) -> FloatArray:
    if values.dtype.kind == "M":
        return (values - np.datetime64(0, "s")) / np.timedelta64(1, "s")
    if values.dtype.kind == "m":
        return values / np.timedelta64(1, "s")
    try:
        return values.astype(np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidValueError(f"{path}, column '{title}' holds no numbers: map another column") from error
