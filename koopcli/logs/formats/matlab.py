"""Files of MATLAB: to 7.2 by scipy; plain numbers of 7.3 by h5py, anything else of it by mat73."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.logs.entries import Source
from koopcli.logs.formats.hdf5 import open_table as open_hdf5
from koopcli.logs.formats.table import Table, arrays_table, extra


def open_table(path: Path, source: Source) -> Table:
    """The table of the arrays of a .mat; fields of structs are named "struct.field"."""
    with path.open("rb") as stream:
        begins = stream.read(128)
    if begins.startswith(b"MATLAB 7.3") or begins.startswith(b"\x89HDF"):
        return _of_hdf5(path, source)
    import scipy.io  # noqa: PLC0415  (only where such a file is met)

    try:
        content = scipy.io.loadmat(path, squeeze_me=True, simplify_cells=True)
    except (ValueError, TypeError, NotImplementedError, KeyError) as error:
        raise InvalidValueError(f"{path} cannot be read as a .mat file: {error}") from error
    return arrays_table(path, dict(_leaves(content)))


def _of_hdf5(path: Path, source: Source) -> Table:
    import h5py  # noqa: PLC0415  (only where such a file is met)

    with h5py.File(path, "r") as file:
        plain = all(isinstance(item, h5py.Dataset) and item.dtype.kind in "fiub" for item in file.values())
    if plain:
        return open_hdf5(path, source)
    return arrays_table(path, dict(_leaves(extra("mat73", "mat73", path).loadmat(str(path)))))


def _leaves(content: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, np.ndarray]]:
    for name, value in content.items():
        if name.startswith("__"):
            continue
        if isinstance(value, Mapping):
            yield from _leaves(value, f"{before}{name}.")
        elif isinstance(value, np.ndarray):
            yield f"{before}{name}", value
