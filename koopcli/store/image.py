"""Records as HDF5: laid out in memory, or in a file of fixed layout where they are large.

HDF5 never writes to an object's final name: an interrupted write would leave a file that opens and lies.
"""

from __future__ import annotations

import io
import json
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from types import MappingProxyType
from typing import Any

import h5py
import numpy as np
from h5py import h5d, h5f, h5g, h5p

from koopcli.errors import InvalidValueError
from koopcli.parsing import TooDeepError, parse_json
from koopcli.records import Array, Meta, Packed
from koopcli.store.files import (
    UntrustedFileError,
    open_regular,
    own_name,
    refuse_without_room,
    reserve,
    size_text,
    write_at,
)
from koopcli.store.identity import canonical, plain, slabs
from koopcli.store.superblock import SUPERBLOCK, mended, refuse_other_formats
from koopcli.store.walk import LARGEST, refusals, refuse, text_beside, walk
from koopcli.text import printable

MEMORY_BLOCK = 1 << 16  # bytes by which an image in memory grows
IMAGE_LIMIT = 32 << 20  # bytes that are laid out in memory, which takes several times as many
MEMORY_LIMIT = 256 << 20  # bytes that are read as a whole
IN_MEMORY = 4 * MEMORY_LIMIT  # bytes that an image in memory may unpack to
META, META_LIMIT = "meta", 16 << 20  # the array that holds the small facts as JSON, and its largest size

Labels = Mapping[str, str | float]  # what people may want to know of a file, beside its record
NO_LABELS: Labels = MappingProxyType({})


def data_bytes(packed: Packed) -> int:
    """Bytes of all arrays."""
    return sum(
        int(np.prod(a.values.shape, dtype=np.int64)) * np.dtype(a.values.dtype).itemsize for a in packed.arrays.values()
    )


def to_bytes(packed: Packed, labels: Labels = NO_LABELS) -> bytes:
    """The HDF5 image; the same record and ``labels`` give the same bytes."""
    _refuse_large_facts(packed.meta)
    access = h5p.create(h5p.FILE_ACCESS)
    access.set_fapl_core(MEMORY_BLOCK, False)
    with _created(own_name(), access) as file:
        for dataset, array in _laid_out(file, packed, labels):
            dataset[...] = array.values[...]
        file.flush()
        return mended(file.id.get_file_image())


def to_file(packed: Packed, path: Path, labels: Labels = NO_LABELS) -> None:
    """The HDF5 image in a new file. HDF5 only lays it out: it does not survive a disk that is full.

    The space is reserved before the first value, and the values are written to their places by plain system calls.
    """
    _refuse_large_facts(packed.meta)
    refuse_without_room(path, data_bytes(packed))
    access = h5p.create(h5p.FILE_ACCESS)
    access.set_file_locking(False, True)
    with _created(path, access) as file:
        places = [(dataset.id.get_offset(), array) for dataset, array in _laid_out(file, packed, labels)]
    descriptor = os.open(path, os.O_RDWR)
    try:
        reserve(descriptor, os.fstat(descriptor).st_size)
        for start, array in places:
            place = start
            for slab in slabs(array.values):
                content = np.ascontiguousarray(slab, dtype=_stored(array)).reshape(-1).view(np.uint8)
                write_at(descriptor, content.data, place)
                place += len(content)
    finally:
        os.close(descriptor)


def from_bytes(image: bytes) -> Packed:
    """The record of an image in memory, its arrays in memory too. Raises ``UntrustedFileError``."""
    with refusals():
        refuse_other_formats(image[:SUPERBLOCK])
        with h5py.File.in_memory(image) as file:
            return loaded(_packed(file, IN_MEMORY))


def loaded(packed: Packed) -> Packed:
    """The same record, its arrays in memory."""
    return Packed({path: Array(a.values[...], a.axes, a.units) for path, a in packed.arrays.items()}, packed.meta)


def from_open(opened: io.FileIO) -> Packed:
    """The record of that very file, whatever its path leads to by now; arrays that are large stay there."""
    with refusals():
        start = bytearray(SUPERBLOCK)
        opened.readinto(start)  # not read(), which verifies nothing
        refuse_other_formats(start)
        file = h5py.File(opened, "r", locking=False)
        try:
            if os.fstat(opened.fileno()).st_size > MEMORY_LIMIT:
                return _packed(file)
            packed = loaded(_packed(file, IN_MEMORY))
        except BaseException:
            file.close()
            raise
        file.close()
        return packed


class _Opened(io.FileIO):
    """A file that is closed with the last array that is read from it."""

    def __del__(self) -> None:
        self.close()


def read_foreign(path: Path) -> Packed:
    """The record of a file that a user names. Raises ``InvalidValueError`` for one that koop would not have written."""
    try:
        with open_regular(path, 0) as (opened, size):
            # Not by its path: that may be another file by now, one as good, or none.
            return from_open(_Opened(os.dup(opened.fileno()))) if size > MEMORY_LIMIT else from_bytes(opened.read())
    except UntrustedFileError as error:
        raise InvalidValueError(f"{printable(str(path))} cannot be used: {error}") from error
    except OSError as error:
        reason = os.strerror(error.errno) if error.errno else "it cannot be read"
        raise InvalidValueError(f"{printable(str(path))} cannot be used: {reason}") from error


def from_path(path: Path) -> Packed:
    """The record of a file that is open only while it is read, as one of many; its arrays stay on disk."""
    with refusals(), h5py.File(path, "r", locking=False) as file:
        lazy = _packed(file)
        arrays = {
            name: Array(_OnDisk(path, name, a.values.shape, a.values.dtype), a.axes, a.units)
            for name, a in lazy.arrays.items()
        }
        return Packed(arrays, lazy.meta)


@dataclass(frozen=True)
class _OnDisk:
    """An array in a file, read when it is indexed."""

    path: Path
    name: str
    shape: tuple[int, ...]
    dtype: Any

    def __getitem__(self, index: Any, /) -> Any:
        with h5py.File(self.path, "r", locking=False) as file:
            return file[self.name][index]


def _refuse_large_facts(meta: Meta) -> None:
    """Raise ``InvalidValueError`` for facts that would be refused when they are read."""
    size = len(json.dumps(plain(meta)))  # in ASCII
    if size > META_LIMIT:
        raise InvalidValueError(
            f"the small facts of an artefact take {size_text(size)}, over {size_text(META_LIMIT)}: "
            "ask for less in one artefact"
        )


def _created(name: str | Path, access: Any) -> h5py.File:
    """A new file of format 1.10. No object in it keeps when it was made: the same record gives the same bytes."""
    access.set_libver_bounds(h5f.LIBVER_V110, h5f.LIBVER_V110)
    access.set_fclose_degree(h5f.CLOSE_STRONG)
    return h5py.File(h5f.create(os.fsencode(name), h5f.ACC_EXCL, fcpl=_timeless(h5p.FILE_CREATE), fapl=access))


def _timeless(kind: Any) -> Any:
    """How to create an object of ``kind`` that does not keep when it was made."""
    how = h5p.create(kind)
    how.set_obj_track_times(False)
    return how


def _laid_out(file: h5py.File, packed: Packed, labels: Labels) -> Iterator[tuple[h5py.Dataset, Array]]:
    """Every array's dataset, with its attributes and without its values; the facts are one too."""
    assert META not in packed.arrays, "the name is taken"
    facts = json.dumps(plain(packed.meta), sort_keys=True).encode()
    arrays = {**packed.arrays, META: Array(np.frombuffer(facts, np.uint8), ("byte_of_meta",), "1")}
    for name, label in labels.items():
        _beside(file, name, label)
    layout = _timeless(h5p.DATASET_CREATE)
    layout.set_layout(h5d.CONTIGUOUS)
    layout.set_alloc_time(h5d.ALLOC_TIME_EARLY)
    layout.set_fill_time(h5d.FILL_TIME_NEVER)
    for group in sorted({str(parent) for path in arrays for parent in PurePosixPath(path).parents} - {"."}):
        h5g.create(file.id, group.encode(), gcpl=_timeless(h5p.GROUP_CREATE))
    for path, array in sorted(arrays.items()):
        dataset = file.create_dataset(path, shape=array.values.shape, dtype=_stored(array), dcpl=layout.copy())
        _beside(dataset, "units", array.units)
        _beside(dataset, "axes", ", ".join(array.axes))
        yield dataset, array


def _beside(item: h5py.HLObject, name: str, value: str | float) -> None:
    """An attribute. A text is of fixed length: those of variable length lie in heaps that no checksum guards."""
    if isinstance(value, str):
        content = value.encode()
        item.attrs.create(name, content, dtype=h5py.string_dtype("utf-8", max(1, len(content))))
    else:
        item.attrs[name] = value


def _stored(array: Array) -> np.dtype[Any]:
    dtype: np.dtype[Any] = np.dtype(array.values.dtype)
    return dtype.newbyteorder("<")


def _packed(file: h5py.File, limit: int = LARGEST) -> Packed:
    """The record of an open file that has passed the walk; its arrays are the file's own datasets."""
    datasets = walk(file, limit)
    meta = _meta(datasets.pop(META, None))
    arrays: dict[str, Array] = {}
    for path, dataset in datasets.items():
        axes, units = text_beside(dataset.id, "axes"), text_beside(dataset.id, "units")
        array = Array(dataset, tuple(axes.split(", ")), units)
        if not (axes + units).isprintable() or len(array.axes) != len(dataset.shape):
            refuse(f"'{path}' lacks the names or the units of its axes")
        if dataset.dtype == bool and any((slab.view(np.uint8) > 1).any() for slab in slabs(dataset)):
            refuse(f"'{path}' holds something between true and false")  # which numpy would count wrongly
        arrays[path] = array
    return Packed(arrays, meta)


def _meta(dataset: h5py.Dataset | None) -> Meta:
    """The small facts of a record."""
    if dataset is None or dataset.dtype != np.uint8 or dataset.ndim != 1 or dataset.size > META_LIMIT:
        refuse("its facts are not a JSON object")
    try:
        meta = parse_json(dataset[...].tobytes())
        canonical(meta)  # finite and of Unicode
    except TooDeepError as error:
        refuse(f"its facts are {error}")
    except (ValueError, InvalidValueError):
        meta = None
    if not isinstance(meta, dict):
        refuse("its facts are not a JSON object")
    return meta
