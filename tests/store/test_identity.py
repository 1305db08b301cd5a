from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from koopcli.errors import InvalidValueError
from koopcli.records import Array, Packed
from koopcli.store import identity, image
from koopcli.store.identity import canonical, data_digest, key_of

TEXT = st.text('a.é\u2028\0😀"\\ ')  # spelled out: the table of all characters takes seconds to make
JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | TEXT,
    lambda inner: st.lists(inner) | st.dictionaries(TEXT, inner),
    max_leaves=20,
)


@dataclass(frozen=True)
class Settings:
    order: int = 7
    levels: tuple[float, ...] = (1.0, 5.0)


@settings(max_examples=20)
@given(st.dictionaries(TEXT, JSON))
def test_order_of_keys_does_not_matter(value):
    assert canonical(dict(reversed(value.items()))) == canonical(value)


def test_one_text_for_one_meaning():
    assert canonical(Settings()) == canonical({"levels": [1.0, 5.0], "order": 7})
    assert canonical({"x": -0.0}) == canonical({"x": 0.0})
    assert canonical({"x": 1}) != canonical({"x": 1.0})
    assert canonical({"x": 0.1}) != canonical({"x": math.nextafter(0.1, 1)})


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_what_is_not_finite_has_no_key(bad):
    with pytest.raises(InvalidValueError):
        key_of({"settings": {"dt": bad}})


def packed(x=None, units="m", meta=None, axes=("row", "column")) -> Packed:
    x = np.arange(6.0).reshape(2, 3) if x is None else x
    return Packed({"a/x": Array(x, axes, units), "b": Array(np.array([True]), ("row",), "1")}, meta or {"dt": 0.1})


def test_the_digest_sees_every_part_of_the_content():
    x = np.arange(6.0).reshape(2, 3)
    digests = {
        data_digest(p)
        for p in (
            packed(),
            packed(units="km"),
            packed(axes=("row", "col")),
            packed(meta={"dt": 0.2}),
            packed(x.reshape(3, 2)),
            packed(x.astype(np.float32)),
            packed(x + 1e-300),
            packed(np.nextafter(x, 1)),
        )
    }
    assert len(digests) == 8


def test_the_digest_does_not_see_how_the_content_is_stored(tmp_path):
    one = packed()
    fortran = packed(np.asfortranarray(np.arange(6.0).reshape(2, 3)))
    big_endian = packed(np.arange(6.0).reshape(2, 3).astype(">f8"))
    image.to_file(one, tmp_path / "x.h5")
    for other in (fortran, big_endian, image.from_bytes(image.to_bytes(one)), image.from_path(tmp_path / "x.h5")):
        assert data_digest(other) == data_digest(one)
    assert image.to_bytes(fortran) == image.to_bytes(one) == image.to_bytes(big_endian)


@pytest.mark.parametrize("shape", [(40,), (7, 5), (3, 4, 5), (2, 40), (0, 3)])
def test_large_arrays_are_hashed_slab_by_slab(monkeypatch, shape):
    """The digest is of all values in order, however many slabs they are read in."""
    monkeypatch.setattr(identity, "SLAB", 100)
    x = np.arange(math.prod(shape), dtype=float).reshape(shape)
    axes = ("a", "b", "c")[: x.ndim]
    head = canonical(["x", "<f8", list(shape), "m", list(axes)])
    plain = hashlib.sha256(head + x.tobytes() + canonical({"dt": 0.1})).hexdigest()
    assert data_digest(Packed({"x": Array(x, axes, "m")}, {"dt": 0.1})) == plain
