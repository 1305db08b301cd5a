"""diff: settings, arrays and facts in which two artefacts or files differ."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest

from koopcli.records import Array, Packed
from koopcli.stages import compare as comparing
from koopcli.stages.compare import compare
from tests.cli.test_errors import one_line


def one(values, units="m", axes=None, meta=None):
    values = np.asarray(values)
    return Packed({"x": Array(values, axes or tuple(f"axis {i}" for i in range(values.ndim)), units)}, meta or {})


def difference(a, b, rtol=1e-9):
    (found,) = compare(a, b, rtol).arrays
    return found


def test_two_fits_of_different_order(koop):
    a, b = koop("fit-edmd", "--order", "1").name, koop("fit-edmd", "--set", "vehicle.Jzz=1731").name
    found = json.loads(koop("diff", a, b, "--json").out)
    assert found["equal"] is False
    assert found["settings"]["fit-edmd.order"] == [1, 2]
    (inertia,) = (pair for name, pair in found["settings"].items() if name.endswith("vehicle.Jzz"))
    assert inertia[1] == 1731
    assert {name.partition(".")[0] for name in found["settings"]} == {"fit-edmd", "trajectories: simulate"}
    assert any(array["layout"][:1] and "shape" in array["layout"][0] for array in found["arrays"].values())
    table = koop("diff", a, b)
    assert table.code == 0
    assert "fit-edmd.order" in table.out
    assert table.out.splitlines()[-1].startswith("different: ")


def test_an_artefact_and_itself(koop, folder):
    name = koop("simulate").name
    found = koop("diff", name, name)
    assert found.code == 0
    assert found.out.splitlines()[-1] == "equal within 1e-09"
    assert "settings that differ" not in found.out
    path = koop("path", name).name
    shutil.copy(path, folder / "copy.h5")
    shutil.copy(path, folder / "copy")
    for other in ("copy.h5", "./copy"):
        told = json.loads(koop("diff", name, other, "--json").out)
        assert told["equal"] is True
        assert told["b"] == other
        assert set(told["arrays"]) >= {"x", "u"}


def test_stages_that_have_little_in_common(koop):
    sample, trajectories = koop("sample").name, koop("simulate").name
    found = json.loads(koop("diff", sample, trajectories, "--json").out)
    assert found["settings"]["stage"] == ["sample", "simulate"]
    assert found["arrays"]["x"]["layout"] == ["only in B"]
    assert found["arrays"]["x"]["max_abs"] is None


def test_a_tolerance_decides(koop, folder):
    name = koop("simulate").name
    content = bytearray((folder / koop("path", name).name).read_bytes())
    import h5py

    (folder / "near.h5").write_bytes(content)
    with h5py.File(folder / "near.h5", "r+") as file:
        x = file["x"][...]
        x[3, 1, 0] *= 1 + 1e-6
        file["x"][...] = x
    strict = json.loads(koop("diff", name, "near.h5", "--json").out)
    assert strict["equal"] is False
    assert strict["arrays"]["x"]["beyond"] == 1
    assert strict["arrays"]["x"]["max_rel"] == pytest.approx(1e-6, rel=1e-3)
    assert strict["arrays"]["x"]["max_abs"] == pytest.approx(1e-6 * abs(x[3, 1, 0]), rel=1e-3)
    assert strict["arrays"]["u"]["equal"] is True
    assert json.loads(koop("diff", name, "near.h5", "--rtol", "2e-6", "--json").out)["equal"] is True


def test_a_damaged_artefact_is_made_again_first(koop, folder):
    name = koop("simulate").name
    path = folder / koop("path", name).name
    path.write_bytes(path.read_bytes()[:-1])
    found = koop("diff", name, name)
    assert found.code == 0
    assert "making it again" in found.err


@pytest.mark.parametrize("rtol", ["-1", "nan", "inf"])
def test_a_tolerance_that_is_none(koop, rtol):
    name = koop("sample").name
    one_line(koop("diff", name, name, "--rtol", rtol), 3, "--rtol must be a finite number")


def test_bad_names(koop, folder):
    name = koop("sample").name
    one_line(koop("diff", name, "abc"), 4, "koop ls")
    one_line(koop("diff", name, "none.h5"), 3, "none.h5")
    (folder / "bad.h5").write_text("no HDF5")
    one_line(koop("diff", "bad.h5", name), 3, "bad.h5")


@pytest.mark.parametrize("slab", [1 << 24, 64])
def test_values_are_compared_in_pieces(monkeypatch, slab):
    monkeypatch.setattr(comparing, "SLAB", slab)
    a = np.arange(600.0).reshape(100, 3, 2) + 1
    b = a.copy()
    b[0, 0, 0] += 1e-3
    b[99, 2, 1] *= 2
    found = difference(one(a), one(b))
    assert found.beyond == 2
    assert found.largest == 600
    assert found.relative == 0.5
    assert found.count == 600
    assert difference(one(a), one(b), rtol=0.5).equal
    assert difference(one(a), one(b), rtol=0.49).beyond == 1


class Lazy:
    """An array that says how much of it was read at once."""

    def __init__(self, rows):
        self.shape, self.dtype, self.most = (rows, 1000), np.dtype(float), 0

    def __getitem__(self, rows):
        count = len(range(*rows.indices(self.shape[0])))
        self.most = max(self.most, count)
        return np.ones((count, 1000))


def test_large_arrays_are_never_read_whole():
    a, b = Lazy(10_000), Lazy(10_000)
    found = difference(Packed({"x": Array(a, ("a", "b"), "m")}), Packed({"x": Array(b, ("a", "b"), "m")}))
    assert found.equal
    assert found.count == 10**7
    assert 8 * 1000 * max(a.most, b.most) <= 1 << 24


@pytest.mark.parametrize(
    ("a", "b", "beyond", "largest"),
    [
        ([np.nan, 1.0], [np.nan, 1.0], 0, 0),
        ([np.nan], [1.0], 1, np.inf),
        ([np.inf, -np.inf], [np.inf, -np.inf], 0, 0),
        ([np.inf], [-np.inf], 1, np.inf),
        ([np.inf], [1.0], 1, np.inf),
        ([0.0], [-0.0], 0, 0),
        ([0.0], [5e-324], 1, 5e-324),
        ([1e308], [-1e308], 1, 2 * np.longdouble(1e308)),
        ([True, False], [True, True], 1, 1),
        (np.array([255, 0], dtype=np.uint8), np.array([0, 255], dtype=np.uint8), 2, 255),
        ([2**62], [2**62 + 1], 0, 1),
        ([1 + 1j], [1 - 1j], 1, 2),
        (["a", "b"], ["a", "c"], 1, np.inf),
        (3.0, 4.0, 1, 1),
        ([], [], 0, 0),
    ],
)
def test_values_of_every_kind(a, b, beyond, largest):
    found = difference(one(a), one(b))
    assert found.beyond == beyond
    assert found.largest == pytest.approx(float(largest), abs=0)
    again = difference(one(b), one(a))
    assert (again.beyond, again.largest, again.relative) == (found.beyond, found.largest, found.relative)


def test_whole_numbers_keep_every_digit():
    assert difference(one([2**62]), one([2**62 + 1]), rtol=0).beyond == 1


def test_what_differs_beside_the_values():
    a = one([[1.0, 2.0]])
    assert difference(a, one([[1.0, 2.0]], units="km")).layout == ("units m | km",)
    assert difference(a, one([[1.0, 2.0]], axes=("a", "b"))).layout[0].startswith("axes")
    assert difference(a, one(np.float32([[1.0, 2.0]]))).layout == ("type float64 | float32",)
    shape = difference(a, one([[1.0], [2.0]]))
    assert shape.layout == ("shape 1 × 2 | 2 × 1",)
    assert shape.largest is None
    assert shape.beyond == 2
    assert not shape.equal
    assert difference(a, one(np.array([[1.0, 2.0]], dtype=">f8"))).equal


def test_facts():
    a = {"n": 3, "deep": {"x": 1.0, "y": [1.0, 2.0]}, "same": None, "text": "a", "flag": True}
    b = {"n": 3.0, "deep": {"x": 1.0 + 1e-12, "y": [1.0, 2.5]}, "same": None, "text": "b", "flag": 1, "new": 0}
    found = compare(one([1.0], meta=a), one([1.0], meta=b), 1e-9)
    assert found.facts == {
        "deep.y": ([1.0, 2.0], [1.0, 2.5]),
        "text": ("a", "b"),
        "flag": (True, 1),
        "new": (None, 0),
    }
    assert not found.equal
