"""The walk through an HDF5 file that anyone may have written: what koop would not write is refused unread.

HDF5 does as a file says: it opens the other files that it names, inflates without end, and believes sizes that were
never stored. So every object is looked at before the first value is read, and nothing but hard links is followed.
"""

from __future__ import annotations

import errno
import math
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NoReturn

import h5py
import numpy as np
from h5py import h5a, h5d, h5g, h5l, h5o, h5s, h5t, h5z

from koopcli.store.files import UntrustedFileError
from koopcli.text import printable

DEPTH = 16  # groups within groups
OBJECTS = 10_000
NAME = 255  # bytes of a name
ATTRIBUTES = 16  # of one object
FACT = 1 << 16  # bytes of an attribute
CHUNK = 64 << 20  # bytes of a chunk, unpacked
CHUNKS = 1_000_000  # of a dataset
LARGEST = 1 << 40  # bytes of all arrays: far beyond any artefact, far below where sums of sizes overflow
RATIO, ALLOWANCE = 100, 1 << 20  # unpacked to stored bytes, above the allowance
KINDS = [
    "?",
    *(f"{order}{kind}" for order in "<>" for kind in ("i1", "i2", "i4", "i8", "f4", "f8", "u1", "u2", "u4", "u8")),
]
TYPES = [h5t.py_create(np.dtype(kind), logical=True) for kind in KINDS]
HEADER, SYMBOL_TABLE = 2, 0x11  # version of an object's header since 1.8, and a message of groups before
FACT_TYPES = (h5t.STRING, h5t.INTEGER, h5t.FLOAT)


@contextmanager
def refusals() -> Iterator[None]:
    """Turn whatever a file from elsewhere makes HDF5 and JSON raise into ``UntrustedFileError``."""
    try:
        yield
    except UntrustedFileError:
        raise
    except Exception as error:
        if isinstance(error, OSError) and error.errno not in (None, 0, errno.EINVAL):  # a place that no file has
            raise  # the disk, not the file
        reason = (str(error).strip("'\"").splitlines() or [type(error).__name__])[0]
        raise UntrustedFileError(f"it is not HDF5 as koop writes it ({printable(reason)[:200]})") from error


def refuse(reason: str) -> NoReturn:
    """Raise ``UntrustedFileError``, on one line of things that can be printed."""
    raise UntrustedFileError(printable(reason))


def walk(file: h5py.File, limit: int = LARGEST) -> dict[str, h5py.Dataset]:
    """Every dataset of ``file`` by its path, found safe to read: at most ``limit`` bytes in all.

    Raises ``UntrustedFileError``, or whatever HDF5 raises on a file that is broken: see :func:`refusals`.
    """
    walked = _Walk(file.id.get_filesize(), limit)
    walked.visit(h5o.open(file.id, b"/"), "", 0)
    return walked.datasets


class _Walk:
    """What was met on the way: no object twice, and no byte of the file counted for two arrays."""

    def __init__(self, size: int, limit: int) -> None:
        self.datasets: dict[str, h5py.Dataset] = {}
        self._seen: set[int] = set()
        self._size, self._limit = size, limit
        self._stored = self._unpacked = 0

    def visit(self, item: Any, path: str, depth: int) -> None:
        """Check the opened ``item`` and all below it."""
        about = h5o.get_info(item)
        address = about.addr
        if about.hdr.version != HEADER or about.hdr.mesg.present >> SYMBOL_TABLE & 1:
            refuse("an object of it is not of format 1.8 or later")
        if address in self._seen:
            refuse(f"'{path}' is linked twice")
        self._seen.add(address)
        if len(self._seen) > OBJECTS or depth > DEPTH:
            refuse(f"it holds over {OBJECTS} objects, or groups over {DEPTH} deep")
        if not isinstance(item, (h5g.GroupID, h5d.DatasetID)):
            refuse(f"'{path}' is neither a group nor an array")
        _check_attributes(item, path)
        if isinstance(item, h5d.DatasetID):
            self._check_dataset(item, path)
            self.datasets[path] = h5py.Dataset(item)
            return
        for name in _names(item, path):
            self.visit(h5o.open(item, name), f"{path}/{name.decode()}".lstrip("/"), depth + 1)

    def _check_dataset(self, dataset: h5d.DatasetID, path: str) -> None:
        """Where the values lie comes first: HDF5 opens other files when asked for as little as a virtual shape."""
        plist = dataset.get_create_plist()
        layout = plist.get_layout()
        if layout == h5d.VIRTUAL or plist.get_external_count():
            refuse(f"the values of '{path}' are in another file")
        kind, space = dataset.get_type(), dataset.get_space()
        if kind.committed() or not any(kind.equal(stored_type) for stored_type in TYPES):
            refuse(f"'{path}' is not of plain numbers")
        if space.get_simple_extent_type() != h5s.SIMPLE:
            refuse(f"'{path}' has no axes")
        shape = space.get_simple_extent_dims()
        unpacked, stored = math.prod(shape) * kind.get_size(), dataset.get_storage_size()
        self._unpacked += unpacked
        self._stored += stored
        if self._unpacked > self._limit or self._stored > self._size:
            refuse(f"'{path}' claims more than there is room for: {unpacked} bytes, {stored} of them stored")
        if self._unpacked > ALLOWANCE + RATIO * self._stored:
            refuse(f"'{path}' unpacks to over {RATIO} times what is stored: {unpacked} bytes from {stored}")
        if layout == h5d.CHUNKED:
            _check_chunks(dataset, plist, shape, path)
        elif stored != unpacked or (dataset.get_offset() or 0) + stored > self._size:
            refuse(f"the values of '{path}' were never stored")


def _names(group: h5g.GroupID, path: str) -> list[bytes]:
    """The names in a group, each one that a path can hold and a hard link."""
    links: list[tuple[bytes, int]] = []

    def collect(name: bytes, link: Any) -> bool:  # h5py lets nothing be raised here
        links.append((name, link.type))
        return len(links) > OBJECTS

    group.links.iterate(collect, info=True)
    if len(links) > OBJECTS:
        refuse(f"it holds over {OBJECTS} objects")
    for name, kind in links:
        text = name.decode()
        if text in ("", ".", "..") or "/" in text or not text.isprintable() or len(name) > NAME:
            refuse(f"the name '{text[:NAME]}' in '/{path}' is not one that koop gives")
        if kind != h5l.TYPE_HARD:
            refuse(f"'{path}/{text}' is a link to elsewhere".replace("'/", "'"))
    return [name for name, _ in links]


def _check_attributes(item: Any, path: str) -> None:
    count = h5a.get_num_attrs(item)
    if count > ATTRIBUTES:
        refuse(f"'/{path}' has over {ATTRIBUTES} attributes")
    for index in range(count):
        fact = h5a.open(item, index=index)
        kind = fact.get_type()
        if kind.committed() or kind.get_class() not in FACT_TYPES or fact.get_storage_size() > FACT:
            refuse(f"an attribute of '/{path}' is neither a text nor a number")
        if kind.get_class() == h5t.STRING and kind.is_variable_str():
            refuse(f"an attribute of '/{path}' is a text of variable length")  # in a heap that no checksum guards


def text_beside(item: Any, name: str) -> str:
    """The text ``name`` beside an ``item`` that has passed the walk; one that cannot be printed if it has none."""
    if not h5a.exists(item, name.encode()):
        return "\0"
    fact = h5a.open(item, name.encode())
    if fact.get_type().get_class() != h5t.STRING or fact.get_space().get_simple_extent_type() != h5s.SCALAR:
        return "\0"
    text = np.empty((), f"S{fact.get_type().get_size()}")
    fact.read(text, fact.get_type())
    return str(text.item(), "utf-8")


def _check_chunks(dataset: h5d.DatasetID, plist: Any, shape: tuple[int, ...], path: str) -> None:
    """Every chunk unpacks to the size of a chunk: HDF5 itself inflates to whatever comes, other filters grow unseen."""
    chunk: tuple[int, ...] = plist.get_chunk()
    width = dataset.get_type().get_size()
    length = math.prod(chunk) * width
    steps = [plist.get_filter(i) for i in range(plist.get_nfilters())]
    filters = [code for code, *_ in steps]
    usual = [*((h5z.FILTER_DEFLATE, (level,)) for level in range(10)), (h5z.FILTER_SHUFFLE, (width,))]
    if length > CHUNK or len(set(filters)) < len(filters) or any((code, how) not in usual for code, _, how, _ in steps):
        refuse(f"'{path}' is packed by other than gzip and shuffle, or in chunks over {CHUNK} bytes")
    grid = math.prod(-(-n // step) for n, step in zip(shape, chunk, strict=True))
    chunks: list[Any] = []

    def collect(piece: Any) -> bool | None:
        chunks.append(piece)
        return len(chunks) > min(grid, CHUNKS) or None

    dataset.chunk_iter(collect)
    if len(chunks) > min(grid, CHUNKS) or len({piece.chunk_offset for piece in chunks}) < len(chunks):
        refuse(f"'{path}' has more chunks than it can hold")
    for piece in chunks:
        if piece.size > 2 * length + 1024:
            refuse(f"a chunk of '{path}' claims bytes that it cannot have")
        skipped, stored = dataset.read_direct_chunk(piece.chunk_offset)
        deflated = any(code == h5z.FILTER_DEFLATE and not skipped >> i & 1 for i, code in enumerate(filters))
        if (_inflated(stored, length) if deflated else len(stored)) != length:
            refuse(f"a chunk of '{path}' does not unpack to its size")


def _inflated(stored: bytes, limit: int) -> int:
    """The bytes that ``stored`` inflates to, or -1 where they are over ``limit`` or never end."""
    engine = zlib.decompressobj()
    length = len(engine.decompress(stored, limit + 1))
    return length if engine.eof else -1
