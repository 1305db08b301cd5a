from __future__ import annotations

import subprocess
import sys

import h5py
import numpy as np

from koopcli.records import Array, Packed
from koopcli.store import image

MAKE = """
import sys, numpy as np
from koopcli.records import Array, Packed
from koopcli.store import image
sys.stdout.buffer.write(image.to_bytes(Packed({"x": Array(np.arange(5.0), ("row",), "m")}, {"b": 1, "a": 2})))
"""


def test_the_same_record_gives_the_same_bytes_in_another_process():
    made = [subprocess.run([sys.executable, "-c", MAKE], capture_output=True, check=True).stdout for _ in range(2)]
    assert made[0] == made[1] == image.to_bytes(Packed({"x": Array(np.arange(5.0), ("row",), "m")}, {"a": 2, "b": 1}))


def test_every_dataset_is_contiguous_and_carries_units_and_axes(tmp_path):
    packed = Packed({"g/x": Array(np.ones((3, 2)), ("row", "state"), "m/s, rad/s")})
    path = tmp_path / "x.h5"
    path.write_bytes(image.to_bytes(packed))
    with h5py.File(path) as file:
        assert file["g/x"].attrs["units"] == "m/s, rad/s"
        assert file["g/x"].attrs["axes"] == "row, state"
        assert file["g/x"].chunks is None
        assert file["g/x"].compression is None


def test_there_and_back(tmp_path):
    packed = Packed({"x": Array(np.arange(12).reshape(3, 4), ("a", "b"), "1")}, {"n": None, "f": 0.1, "l": [1, "é"]})
    image.to_file(packed, tmp_path / "x.h5")
    for again in (image.from_bytes(image.to_bytes(packed)), image.from_path(tmp_path / "x.h5")):
        assert again.meta == packed.meta
        assert again.arrays["x"].axes == ("a", "b")
        assert (again.arrays["x"].values[...] == packed.arrays["x"].values).all()


def test_an_empty_array_survives():
    packed = Packed({"x": Array(np.empty((0, 3)), ("a", "b"), "1")})
    assert image.from_bytes(image.to_bytes(packed)).arrays["x"].values.shape == (0, 3)
