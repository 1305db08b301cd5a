from __future__ import annotations

import os
import subprocess
import sys

import h5py
import numpy as np

from koopcli.records import Array, Packed
from koopcli.store import files, image
from koopcli.store.superblock import SUPERBLOCK, lookup3, mended
from tests.store.checksums import sums

MAKE = """
import sys, numpy as np
from koopcli.records import Array, Packed
from koopcli.store import image
sys.stdout.buffer.write(image.to_bytes(Packed({"x": Array(np.arange(5.0), ("row",), "m")}, {"b": 1, "a": 2})))
"""


def test_the_same_record_gives_the_same_bytes_in_another_process():
    made = [subprocess.run([sys.executable, "-c", MAKE], capture_output=True, check=True).stdout for _ in range(2)]
    assert made[0] == made[1] == image.to_bytes(Packed({"x": Array(np.arange(5.0), ("row",), "m")}, {"a": 2, "b": 1}))


def test_every_checksum_of_an_image_is_right():
    """Of the superblock too, where HDF5 below 2.0 leaves the one of a file that is being written."""
    content = image.to_bytes(Packed({"g/x": Array(np.arange(5.0), ("row",), "m")}, {"a": 1}))
    places = sums(content)
    assert len(places) >= 4
    assert all(lookup3(content[start:end]) == content[end : end + 4] for start, end in places)
    being_written = content[:11] + b"\1" + content[12:SUPERBLOCK]
    assert mended(content[:SUPERBLOCK] + lookup3(being_written) + content[SUPERBLOCK + 4 :]) == content


def test_no_object_keeps_when_it_was_made(tmp_path):
    packed = Packed({"g/h/x": Array(np.arange(5.0), ("row",), "m")}, {"a": 1})
    (tmp_path / "memory.h5").write_bytes(image.to_bytes(packed))
    image.to_file(packed, tmp_path / "file.h5")
    for name in ("memory.h5", "file.h5"):
        with h5py.File(tmp_path / name) as file:
            for path in ("/", "g", "g/h", "g/h/x"):
                assert h5py.h5o.get_info(file[path].id).mtime == 0


def test_every_dataset_is_contiguous_and_carries_units_and_axes(tmp_path):
    packed = Packed({"g/x": Array(np.ones((3, 2)), ("row", "state"), "m/s, rad/s")})
    path = tmp_path / "x.h5"
    path.write_bytes(image.to_bytes(packed))
    with h5py.File(path) as file:
        assert file["g/x"].attrs["units"] == b"m/s, rad/s"
        assert file["g/x"].attrs["axes"] == b"row, state"
        assert file["g/x"].chunks is None
        assert file["g/x"].compression is None


def test_there_and_back(tmp_path):
    packed = Packed({"x": Array(np.arange(12).reshape(3, 4), ("a", "b"), "1")}, {"n": None, "f": 0.1, "l": [1, "é"]})
    image.to_file(packed, tmp_path / "x.h5")
    for again in (image.from_bytes(image.to_bytes(packed)), image.from_path(tmp_path / "x.h5")):
        assert again.meta == packed.meta
        assert again.arrays["x"].axes == ("a", "b")
        assert (again.arrays["x"].values[...] == packed.arrays["x"].values).all()


def test_a_large_record_where_no_call_reserves_space(tmp_path, monkeypatch):
    packed = Packed({"x": Array(np.arange(3000.0), ("row",), "m"), "e": Array(np.empty((0, 3)), ("a", "b"), "1")})
    image.to_file(packed, tmp_path / "reserved.h5")
    monkeypatch.delattr(os, "posix_fallocate", raising=False)
    monkeypatch.setattr(files, "PIECE", 1000)
    written = []
    monkeypatch.setattr(files, "write_at", lambda to, content, place: written.append((place, len(content))))
    image.to_file(packed, tmp_path / "written.h5")
    content = (tmp_path / "reserved.h5").read_bytes()
    assert (tmp_path / "written.h5").read_bytes() == content
    assert written[0] == (0, 1000)
    assert sum(length for _, length in written) == len(content)


def test_an_empty_array_survives():
    packed = Packed({"x": Array(np.empty((0, 3)), ("a", "b"), "1")})
    assert image.from_bytes(image.to_bytes(packed)).arrays["x"].values.shape == (0, 3)
