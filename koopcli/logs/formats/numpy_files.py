"""Arrays of numpy: one in a .npy, with or without that ending, and named ones in a .npz."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.logs.entries import Source
from koopcli.logs.formats.table import Table, arrays_table


def open_table(path: Path, source: Source) -> Table:
    """The table of a .npy (rows,) or (rows, columns), without names, or of the arrays of a .npz by theirs."""
    try:
        with path.open("rb") as stream:
            return arrays_table(path, _arrays(np.load(stream, allow_pickle=False)))
    except (ValueError, EOFError, KeyError, BadZipFile) as error:
        raise InvalidValueError(
            f"{path} cannot be read as arrays of numbers: {' '.join(str(error).split())}"
        ) from error


def _arrays(content: Any) -> dict[str, np.ndarray]:
    if not isinstance(content, np.ndarray):
        arrays = {name: content[name] for name in content.files}
        return {name: array for name, array in arrays.items() if isinstance(array, np.ndarray)}
    if content.dtype.names is not None:
        return {name: content[name] for name in content.dtype.names}
    return {"": content}
