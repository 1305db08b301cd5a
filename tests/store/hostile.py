"""Files that koop would not write, each with one thing wrong, made to do harm where nothing stands in their way."""

from __future__ import annotations

import ctypes
import io
import os
import struct
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import h5py
import numpy as np
from h5py import h5a, h5d, h5p, h5s, h5t, h5z

from tests.store.checksums import sums, with_sums

Make = Callable[[h5py.File, Path], None]
CASES: dict[str, tuple[Make, str]] = {}
RAW: dict[str, tuple[Callable[[bytes], bytes], str]] = {}
LENGTH = 64  # bytes of the secret
DEEP = "facts are nested over 64 levels deep"
FOREIGN = "in another file|link to elsewhere"


def case(reason: str) -> Callable[[Make], Make]:
    """Add what the function does to an honest file to the corpus; it is refused for ``reason``."""

    def add(make: Make) -> Make:
        CASES[make.__name__] = make, reason
        return make

    return add


def raw(reason: str) -> Callable[[Callable[[bytes], bytes]], Callable[[bytes], bytes]]:
    """The same for what a function does to the bytes of an honest file."""

    def add(make: Callable[[bytes], bytes]) -> Callable[[bytes], bytes]:
        RAW[make.__name__] = make, reason
        return make

    return add


def honest(file: h5py.File) -> None:
    put_facts(file, '{"dt": 0.1}')
    describe(file.create_dataset("x", data=np.arange(LENGTH, dtype=np.uint8)))


def put_facts(file: h5py.File, text: str) -> None:
    describe(file.create_dataset("meta", data=np.frombuffer(text.encode(), np.uint8)), "byte")


def describe(dataset: h5py.Dataset, axes: str = "row", units: str = "1") -> None:
    dataset.attrs["units"] = np.bytes_(units)
    dataset.attrs["axes"] = np.bytes_(axes)


def make(name: str, path: Path, secret: Path) -> Path:
    """The file ``name`` of the corpus at ``path``; ``secret`` is an honest file whose array it has no right to."""
    with h5py.File(path, "w", libver=("v110", "v110")) as file:
        honest(file)
        if name in CASES:
            CASES[name][0](file, secret)
    if name in RAW:
        path.write_bytes(RAW[name][0](path.read_bytes()))
    return path


@contextmanager
def watched(path: Path) -> Iterator[list[bytes]]:
    """After the block, a list that is empty if nothing, in C or in Python, opened ``path`` meanwhile."""
    libc = ctypes.CDLL(None, use_errno=True)
    descriptor = libc.inotify_init1(os.O_NONBLOCK)
    if descriptor < 0 or libc.inotify_add_watch(descriptor, bytes(path), 0x21) < 0:  # opened or read
        raise OSError(ctypes.get_errno(), "inotify")
    seen: list[bytes] = []
    try:
        yield seen
        with suppress(BlockingIOError):
            seen.append(os.read(descriptor, 4096))
    finally:
        os.close(descriptor)


# other files


def _place(secret: Path) -> int:
    with h5py.File(secret) as file:
        return int(file["x"].id.get_offset())


@case(FOREIGN)
def external_storage(file, secret):
    outside = [(str(secret), _place(secret), LENGTH)]
    describe(file.create_dataset("evil", (LENGTH,), np.uint8, external=outside))


@case(FOREIGN)
def external_link(file, secret):
    file["evil"] = h5py.ExternalLink(str(secret), "/x")


@case(FOREIGN)
def external_link_to_a_group(file, secret):
    file["group"] = h5py.ExternalLink(str(secret), "/")


@case(FOREIGN)
def soft_link_over_an_external_link(file, secret):
    file["evil"] = h5py.SoftLink("/nested/there")
    file["nested/there"] = h5py.ExternalLink(str(secret), "/x")


@case(FOREIGN)
def virtual_dataset(file, secret):
    layout = h5py.VirtualLayout((LENGTH,), np.uint8)
    layout[:] = h5py.VirtualSource(str(secret), "x", (LENGTH,))
    describe(file.create_virtual_dataset("evil", layout))


@case(FOREIGN)
def virtual_dataset_without_end(file, secret):
    """HDF5 opens the other file as soon as it is asked for the shape."""
    layout = h5py.VirtualLayout((LENGTH,), np.uint8, maxshape=(None,))
    source = h5py.VirtualSource(str(secret), "x", (LENGTH,), maxshape=(None,))
    layout[: h5s.UNLIMITED] = source[: h5s.UNLIMITED]
    describe(file.create_virtual_dataset("evil", layout))


@case("link to elsewhere")
def soft_link(file, secret):
    file["alias"] = h5py.SoftLink("/x")


# types


def _of_type(file: h5py.File, kind: h5t.TypeID, name: bytes = b"evil") -> None:
    describe(h5py.Dataset(h5d.create(file.id, name, kind, h5s.create_simple((4,)), _early())))


def _early() -> h5p.PropDCID:
    layout = h5p.create(h5p.DATASET_CREATE)
    layout.set_alloc_time(h5d.ALLOC_TIME_EARLY)
    return layout


@case("plain numbers")
def object_references(file, secret):
    describe(file.create_dataset("evil", data=[file["x"].ref], dtype=h5py.ref_dtype))


@case("plain numbers")
def region_references(file, secret):
    describe(file.create_dataset("evil", data=[file["x"].regionref[:2]], dtype=h5py.regionref_dtype))


@case("plain numbers")
def opaque(file, secret):
    describe(file.create_dataset("evil", data=np.zeros(4, "V8")))


@case("plain numbers")
def compound(file, secret):
    describe(file.create_dataset("evil", data=np.zeros(4, [("a", float), ("b", int)])))


@case("plain numbers")
def of_variable_length(file, secret):
    describe(file.create_dataset("evil", (4,), h5py.vlen_dtype(float)))


@case("plain numbers")
def strings(file, secret):
    describe(file.create_dataset("evil", data=["a", "b"]))


@case("plain numbers")
def fixed_strings(file, secret):
    describe(file.create_dataset("evil", data=np.array([b"a", b"b"])))


@case("plain numbers")
def bit_field(file, secret):
    _of_type(file, h5t.STD_B8LE)


@case("plain numbers")
def time(file, secret):
    _of_type(file, h5t.UNIX_D32LE)


@case("plain numbers")
def array_type(file, secret):
    _of_type(file, h5t.array_create(h5t.IEEE_F64LE, (2,)))


@case("plain numbers")
def enumeration(file, secret):
    describe(file.create_dataset("evil", (4,), h5py.enum_dtype({"a": 0, "b": 7})))


@case("plain numbers")
def odd_integer(file, secret):
    kind = h5t.STD_I64LE.copy()
    kind.set_precision(13)
    _of_type(file, kind)


@case("plain numbers")
def committed_type_in_use(file, secret):
    kind = h5t.IEEE_F64LE.copy()
    kind.commit(file.id, b"kind")
    _of_type(file, kind)


@case("neither a group nor an array")
def committed_type(file, secret):
    file["kind"] = np.dtype(float)


@case("between true and false")
def neither_true_nor_false(file, secret):
    """numpy counts such a truth as seven and believes the count."""
    describe(file.create_dataset("evil", data=np.array([7, 7], np.uint8).view(bool)))


@case("no axes")
def scalar(file, secret):
    describe(file.create_dataset("evil", data=1.0))


@case("no axes")
def no_space(file, secret):
    describe(file.create_dataset("evil", data=h5py.Empty(float)))


# sizes


def _chunked(file: h5py.File, shape: tuple[int, ...], chunk: tuple[int, ...], *filters: int) -> h5py.Dataset:
    layout = h5p.create(h5p.DATASET_CREATE)
    layout.set_chunk(chunk)
    for code in filters:
        layout.set_filter(code, h5z.FLAG_OPTIONAL, (6,))
    dataset = h5py.Dataset(h5d.create(file.id, b"evil", h5t.IEEE_F64LE, h5s.create_simple(shape), layout))
    describe(dataset, ", ".join("abc"[: len(shape)]))
    return dataset


@case("unpacks to over 100 times")
def bomb(file, secret):
    describe(file.create_dataset("evil", data=np.zeros(1 << 20), chunks=(1 << 17,), compression=9))


@case("does not unpack to its size")
def bomb_in_a_small_chunk(file, secret):
    """HDF5 inflates all there is before it compares it with what was declared."""
    packed = zlib.compress(bytes(1 << 20), 9)
    _chunked(file, (1024,), (1024,), h5z.FILTER_DEFLATE).id.write_direct_chunk((0,), packed)


@case("packed by other")
def bomb_in_a_bomb(file, secret):
    packed = zlib.compress(zlib.compress(bytes(1 << 23), 9), 9)
    deflate = (h5z.FILTER_DEFLATE, h5z.FILTER_DEFLATE)
    _chunked(file, (1 << 17,), (1 << 17,), *deflate).id.write_direct_chunk((0,), packed)


@case("does not unpack to its size")
def stream_without_end(file, secret):
    _chunked(file, (64,), (64,), h5z.FILTER_DEFLATE).id.write_direct_chunk((0,), zlib.compress(bytes(512))[:-4])


@case("claims bytes")
def junk_behind_a_chunk(file, secret):
    packed = zlib.compress(bytes(512)) + bytes(100_000)
    _chunked(file, (64,), (64,), h5z.FILTER_DEFLATE).id.write_direct_chunk((0,), packed)


@case("does not unpack to its size")
def short_chunk(file, secret):
    _chunked(file, (1024,), (1024,), h5z.FILTER_DEFLATE).id.write_direct_chunk((0,), bytes(8), filter_mask=1)


@case("room for|unpacks to")
def eight_terabytes(file, secret):
    _chunked(file, (1 << 40,), (1 << 17,))


@case("room for")
def more_bytes_than_64_bits_count(file, secret):
    _chunked(file, (1 << 40, 1 << 40), (1, 1))


@case("room for|unpacks to")
def eight_terabytes_in_one_piece(file, secret):
    describe(file.create_dataset("evil", (1 << 40,), float))


@case("never stored")
def never_written(file, secret):
    describe(file.create_dataset("evil", (16,), float))


@case("chunks over")
def huge_chunk(file, secret):
    _chunked(file, (9 << 20,), (9 << 20,), h5z.FILTER_DEFLATE).id.write_direct_chunk((0,), bytes(1 << 20))


@case("packed by other")
def unknown_filter(file, secret):
    _chunked(file, (4,), (4,), 32_015)[...] = 1


@case("packed by other")
def lzf(file, secret):
    describe(file.create_dataset("evil", data=np.ones(64), chunks=(64,), compression="lzf"))


@case("packed by other")
def scale_offset(file, secret):
    describe(file.create_dataset("evil", data=np.ones(64, int), chunks=(64,), scaleoffset=0))


# links and names


@case("linked twice")
def cycle(file, secret):
    file.create_group("group")["again"] = file["/"]


@case("linked twice")
def linked_twice(file, secret):
    file["again"] = file["x"]


@case("over 16 deep")
def a_hundred_deep(file, secret):
    file.create_group("/".join(["g"] * 100))


@case("the name")
def parent_as_a_name(file, secret):
    file.id.links.create_hard(b"..", file.id, b"x")


@case("the name")
def escape_in_a_name(file, secret):
    file.create_group("\x1b[2J")


@case("can't decode")
def no_unicode_in_a_name(file, secret):
    file.id.links.create_hard(b"\xff\xfe", file.id, b"x")


@case("the name")
def endless_name(file, secret):
    file.create_group("n" * 5000)


# texts and attributes


@case("neither a text nor a number")
def reference_beside_an_array(file, secret):
    file["x"].attrs["evil"] = file["x"].ref


@case("neither a text nor a number")
def list_beside_an_array(file, secret):
    h5a.create(file["x"].id, b"evil", h5t.vlen_create(h5t.STD_I64LE), h5s.create(h5s.SCALAR))


@case("neither a text nor a number")
def committed_type_beside_an_array(file, secret):
    kind = h5t.IEEE_F64LE.copy()
    kind.commit(file.create_group("z").id, b"kind")
    h5a.create(file["x"].id, b"evil", kind, h5s.create(h5s.SCALAR))


@case("over 16 attributes")
def a_hundred_attributes(file, secret):
    for i in range(100):
        file["x"].attrs[f"a{i}"] = i


@case("lacks the names or the units")
def fewer_axes_than_named(file, secret):
    file["x"].attrs["axes"] = np.bytes_("row, column")


@case("lacks the names or the units")
def no_units(file, secret):
    del file["x"].attrs["units"]


@case("lacks the names or the units")
def units_that_are_a_number(file, secret):
    file["x"].attrs["units"] = 1.0


@case("lacks the names or the units")
def escape_in_the_units(file, secret):
    file["x"].attrs["units"] = np.bytes_("\x1b]0;evil\x07")


@case("lacks the names or the units")
def units_in_a_list(file, secret):
    file["x"].attrs["units"] = np.array([b"1", b"1"])


@case("can't decode")
def units_without_unicode(file, secret):
    file["x"].attrs["units"] = np.bytes_(b"\xff\xfe")


@case("text of variable length")
def units_of_variable_length(file, secret):
    file["x"].attrs["units"] = "m"


@case("text of variable length")
def a_text_of_variable_length_beside_the_root(file, secret):
    file.attrs["title"] = "evil"


def _meta(name: str, text: str | None, reason: str = "facts are not a JSON object") -> None:
    def change(file, secret):
        del file["meta"]
        if text is not None:
            put_facts(file, text)

    CASES[name] = change, reason


_meta("no_facts", None)
_meta("facts_that_are_a_list", "[]")
_meta("facts_that_are_no_json", "{")
_meta("facts_without_end", '{"a":' + "[" * 100_000 + "]" * 100_000 + "}", DEEP)
_meta("facts_too_deep", '{"a":' + "[" * 64 + "]" * 64 + "}", DEEP)
_meta("facts_not_a_number", '{"a": NaN}')
_meta("facts_of_half_a_character", '{"a": "\\ud800"}')


@case("facts are not a JSON object")
def facts_in_a_table(file, secret):
    del file["meta"]
    describe(file.create_dataset("meta", data=np.frombuffer(b'{"a":1}\n', np.uint8).reshape(2, 4)), "row, byte")


@case("facts are not a JSON object")
def facts_that_are_a_group(file, secret):
    del file["meta"]
    describe(file.create_dataset("meta/x", data=np.arange(3)))


# bytes


@raw("format 1.8 or later")
def old_groups(content):
    """Their names lie in heaps that no checksum guards."""
    memory = io.BytesIO()
    with h5py.File(memory, "w", libver=("earliest", "v110")) as file:
        honest(file)
        file.create_group("group")["y"] = np.arange(3)
    return memory.getvalue()


@raw("format 1.8 or later")
def not_hdf5(content):
    return b"\x93NUMPY" + content


@raw("format 1.8 or later")
def nothing(content):
    return b"\x89"


@raw("format 1.8 or later")
def behind_something_else(content):
    return bytes(512) + content


@raw("format 1.8 or later")
def pickled(content):
    return b"cos\nsystem\n(S'true'\ntR."


@raw("truncated file")
def cut_off(content):
    return content[:-100]


def _with_heap(content: bytes) -> bytes:
    """The file with a text of variable length."""
    memory = io.BytesIO(content)
    with h5py.File(memory, "r+", libver=("v110", "v110")) as file:
        file.attrs["title"] = "abc"
    return memory.getvalue()


@raw("text of variable length")
def heap_that_goes_nowhere(content):
    """A text of no step to the next one: HDF5 never returns from it."""
    content = _with_heap(content)
    heap = content.index(b"GCOL") + 16
    return content[:heap] + struct.pack("<HHIQ", 0, 0, 0, 0) + content[heap + 16 :]


@raw("text of variable length")
def text_of_gigabytes(content):
    """HDF5 clears the memory for it before it finds that the text has three letters."""
    content = _with_heap(content)
    changed = bytearray(content)
    length = content.index(struct.pack("<IQ", 3, content.index(b"GCOL")))
    changed[length + 3] = 0x3F
    return with_sums(changed, sums(content))


def _patched(content: bytes, place: int, size: int) -> bytes:
    """The layout of the array moved to ``place``, its size and its shape made ``size``."""
    start = content.rindex(b"OHDR")
    old = struct.pack("<Q", LENGTH)
    with h5py.File(io.BytesIO(content)) as file:
        layout = struct.pack("<Q", file["x"].id.get_offset()) + old
    end = content.index(layout, start) + 16
    head = content[start : end - 16].replace(old, struct.pack("<Q", size)) + struct.pack("<QQ", place, size)
    return with_sums(bytearray(content[:start] + head + content[end:]), sums(content))


@raw("invalid dataset size|never stored")
def values_past_the_end(content):
    return _patched(content, len(content) - LENGTH // 2, LENGTH)


@raw("invalid dataset size|room for")
def more_values_than_the_file_has(content):
    return _patched(content, 48, len(content) + 1)


@raw("room for")
def one_array_many_times(content):
    """Ten arrays of the same bytes: what takes little to store is read again and again."""
    memory = io.BytesIO(content)
    size = 1 << 16
    with h5py.File(memory, "r+", libver=("v110", "v110")) as file:
        describe(file.create_dataset("all", data=np.ones(size, np.uint8)))
        place = struct.pack("<Q", file["all"].id.get_offset())
        for i in range(9):
            describe(file.create_dataset(f"again{i}", (size,), np.uint8))
    content, length = memory.getvalue(), struct.pack("<Q", size)
    return with_sums(bytearray(content.replace(b"\xff" * 8 + length, place + length)), sums(content))
