"""HDF5: every dataset of numbers is a column by its path, one of two axes several."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from koopcli.logs.entries import Source
from koopcli.logs.formats.table import Table, shaped_table


def open_table(path: Path, source: Source) -> Table:
    """The table of the datasets (rows,) and (rows, columns) of a file, whose attribute "units" or "unit" counts."""
    import h5py  # noqa: PLC0415  (only where such a file is met)

    shapes: dict[str, tuple[int, ...]] = {}
    units: dict[str, str] = {}

    def visit(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and item.dtype.kind in "fiub" and not name.startswith("#"):
            shapes[name] = item.shape
            said = item.attrs.get("units", item.attrs.get("unit", ""))
            units[name] = said.decode() if isinstance(said, bytes) else str(said)

    def column(name: str, place: int, turned: bool) -> np.ndarray:
        with h5py.File(path, "r") as file:
            dataset = file[name]
            content = dataset[...] if dataset.ndim == 1 else dataset[place] if turned else dataset[:, place]
            return np.asarray(content)

    with h5py.File(path, "r") as file:
        file.visititems(visit)
    return shaped_table(path, shapes, column, units)
