"""HDF5: every dataset of numbers is a column by its path, one of two axes several."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from koopcli.logs.entries import Source
from koopcli.logs.formats.table import Table, arrays_table


def open_table(path: Path, source: Source) -> Table:
    """The table of the datasets (rows,) and (rows, columns) of a file, whose attribute "units" or "unit" counts."""
    return datasets(path, turned=False)


def datasets(path: Path, turned: bool) -> Table:
    """The table of a file; ``turned``: its axes run the other way round, as MATLAB writes them."""
    import h5py  # noqa: PLC0415  (only where such a file is met)

    arrays: dict[str, np.ndarray] = {}
    units: dict[str, str] = {}

    def visit(name: str, item: Any) -> None:
        if not isinstance(item, h5py.Dataset) or item.dtype.kind not in "fiub" or item.ndim not in (1, 2):
            return
        if name.startswith("#"):
            return
        arrays[name] = item[...].T if turned else item[...]
        said = item.attrs.get("units", item.attrs.get("unit", ""))
        units[name] = said.decode() if isinstance(said, bytes) else str(said)

    with h5py.File(path, "r") as file:
        file.visititems(visit)
    return arrays_table(path, arrays, units)
