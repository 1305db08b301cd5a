"""Formats of logs: one file for each, chosen by the ending of a path, or by the first bytes where it has none."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

from koopcli.errors import InvalidValueError
from koopcli.logs.entries import Source
from koopcli.logs.formats.table import Table

BY_ENDING = {
    ".npy": "numpy_files",
    ".npz": "numpy_files",
    ".h5": "hdf5",
    ".hdf5": "hdf5",
    ".hdf": "hdf5",
    ".mat": "matlab",
    ".mf4": "mdf",
    ".mdf": "mdf",
    ".dat": "mdf",
    ".bag": "ros",
    ".db3": "ros",
    ".mcap": "ros",
    ".parquet": "parquet",
    ".pq": "parquet",
}
BY_BYTES = (
    (b"\x93NUMPY", "numpy_files"),
    (b"PK\x03\x04", "numpy_files"),
    (b"\x89HDF\r\n\x1a\n", "hdf5"),
    (b"MATLAB 7.3", "matlab"),
    (b"MATLAB 5.0", "matlab"),
    (b"MDF ", "mdf"),
    (b"UnFinMF ", "mdf"),
    (b"#ROSBAG", "ros"),
    (b"\x89MCAP", "ros"),
    (b"PAR1", "parquet"),
)


def format_of(path: Path) -> str:
    """The name of the module that reads a file: by its first bytes, then by its ending, else "delimited", text."""
    with path.open("rb") as stream:
        begins = stream.read(16)
    for magic, name in BY_BYTES:
        if begins.startswith(magic):
            return "matlab" if path.suffix.casefold() == ".mat" and name == "hdf5" else name
    by_ending = BY_ENDING.get(path.suffix.casefold(), "delimited")
    return "delimited" if path.suffix.casefold() == ".dat" else by_ending


def open_table(path: Path, source: Source | None = None) -> Table:
    """The columns of a file, none read yet; ``source``: what the map says of its layout, for text.

    Raises ``InvalidValueError`` for a file that cannot be read, that is empty, or whose library is not installed.
    """
    try:
        if path.stat().st_size == 0:
            raise InvalidValueError(f"{path} is empty: a log with rows of numbers was expected")
        module = import_module(f"{__name__}.{format_of(path)}")
        table: Table = module.open_table(path, source if source is not None else Source(""))
    except OSError as error:
        raise InvalidValueError(f"{path} cannot be read: {error.strerror or error}") from error
    return table
