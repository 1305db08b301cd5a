"""Records as HDF5: laid out in memory, or in a file of fixed layout where they are large.

HDF5 never writes to an object's final name: an interrupted write would leave a file that opens and lies.
"""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np

from koopcli.records import Array, Packed
from koopcli.store.identity import plain, slabs

MEMORY_LIMIT = 256 << 20


def data_bytes(packed: Packed) -> int:
    """Bytes of all arrays."""
    return sum(
        int(np.prod(a.values.shape, dtype=np.int64)) * np.dtype(a.values.dtype).itemsize for a in packed.arrays.values()
    )


def to_bytes(packed: Packed) -> bytes:
    """The HDF5 image; the same record gives the same bytes."""
    with h5py.File.in_memory(libver=("v110", "v110")) as file:
        _fill(file, packed)
        file.flush()
        return bytes(file.id.get_file_image())


def to_file(packed: Packed, path: Path) -> None:
    """The HDF5 image in a new file, array by array in slabs, with all space reserved before the first value."""
    with h5py.File(path, "x", libver=("v110", "v110"), locking=False) as file:
        _fill(file, packed)


def from_bytes(image: bytes) -> Packed:
    """The record of an image in memory, its arrays in memory too."""
    with h5py.File.in_memory(image) as file:
        lazy = _packed(file)
        arrays = {path: Array(array.values[...], array.axes, array.units) for path, array in lazy.arrays.items()}
        return Packed(arrays, lazy.meta)


def from_file(path: Path) -> Packed:
    """The record of a file, its arrays left on disk."""
    return _packed(h5py.File(path, "r", locking=False))


def _fill(file: h5py.File, packed: Packed) -> None:
    file.attrs["meta"] = json.dumps(plain(packed.meta), sort_keys=True)
    layout = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    layout.set_layout(h5py.h5d.CONTIGUOUS)
    layout.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    layout.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
    for path, array in sorted(packed.arrays.items()):
        dtype = np.dtype(array.values.dtype).newbyteorder("<")
        dataset = file.create_dataset(path, shape=array.values.shape, dtype=dtype, dcpl=layout.copy())
        dataset.attrs["units"] = array.units
        dataset.attrs["axes"] = ", ".join(array.axes)
        start = 0
        for slab in slabs(array.values):
            dataset[start : start + len(slab)] = slab
            start += len(slab)


def _packed(file: h5py.File) -> Packed:
    arrays: dict[str, Array] = {}

    def visit(name: str, item: object) -> None:
        if isinstance(item, h5py.Dataset):
            arrays[name] = Array(item, tuple(item.attrs["axes"].split(", ")), item.attrs["units"])

    file.visititems(visit)
    return Packed(arrays, json.loads(file.attrs["meta"]))
