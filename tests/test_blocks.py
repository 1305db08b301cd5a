from __future__ import annotations

from itertools import pairwise

import h5py
import numpy as np
import pytest

from koopcli.blocks import Chosen, Joined, blocks

VALUES = np.arange(60.0).reshape(12, 5)
SLICES = [slice(None), slice(0, 0), slice(3, 4), slice(2, 9), slice(-4, None), slice(11, 40)]


def joined(cuts):
    edges = [0, *cuts, len(VALUES)]
    return Joined([VALUES[a:b] for a, b in pairwise(edges)])


@pytest.mark.parametrize("cuts", [[], [3], [0, 3, 3, 11], [1, 2, 12]])
@pytest.mark.parametrize("rows", SLICES)
def test_joined_is_the_concatenation(cuts, rows):
    whole = joined(cuts)
    assert whole.shape == VALUES.shape
    assert whole.dtype == VALUES.dtype
    assert (whole[rows] == VALUES[rows]).all()
    assert (whole[rows, 1:3] == VALUES[rows, 1:3]).all()
    assert (whole[...] == VALUES).all()


@pytest.mark.parametrize("rows", [*SLICES, 2, np.array([1, 3, 0]), np.array([], dtype=int)])
@pytest.mark.parametrize("on_disk", [False, True])
def test_chosen_is_fancy_indexing(tmp_path, rows, on_disk):
    kept = np.array([0, 1, 4, 5, 9, 11])
    with h5py.File(tmp_path / "x.h5", "w") as file:
        values = file.create_dataset("x", data=VALUES) if on_disk else VALUES
        chosen = Chosen(values, kept)
        assert chosen.shape == (6, 5)
        assert (chosen[rows] == VALUES[kept][rows]).all()
        assert np.shape(chosen[rows]) == np.shape(VALUES[kept][rows])
        assert (chosen[rows, :2] == VALUES[kept][rows, :2]).all()


def test_blocks_know_no_last_axis():
    for whole in (joined([3]), Chosen(VALUES, np.array([1]))):
        with pytest.raises(IndexError):
            whole[..., 1]


def test_blocks_cover_a_slice_once():
    assert list(blocks(slice(3, 10), 3)) == [slice(3, 6), slice(6, 9), slice(9, 10)]
    assert list(blocks(slice(3, 3), 3)) == []
