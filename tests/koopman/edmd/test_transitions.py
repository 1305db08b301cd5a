from __future__ import annotations

import numpy as np
import pytest

from koopcli.errors import InvalidValueError
from koopcli.koopman.edmd.transitions import Transitions
from koopcli.records import Trajectories
from tests.koopman.edmd.delayed import channels, episodes_of


@pytest.fixture
def numbered():
    """Episodes of 7, 2, 3 and 12 rows whose values say which row they are."""
    lengths = (7, 2, 3, 12)
    rows = np.split(np.arange(24.0), np.cumsum(lengths)[:-1])
    return episodes_of([np.column_stack([r, -r]) for r in rows], [100 + r[:, np.newaxis] for r in rows])


def windows(data, memory, rows, span=None):
    parts = list(Transitions.of(data).windows(memory, rows, span))
    assert all(len(part.x) <= rows for part in parts)
    return [np.concatenate(values) for values in zip(*parts, strict=True)]


@pytest.mark.parametrize("memory", [0, 1, 2, 5])
@pytest.mark.parametrize("rows", [1, 3, 5, 100])
def test_pairs_and_their_past_stay_inside_an_episode(numbered, memory, rows):
    """Every row but the last of an episode, and but the first ones that have no past, once and in order."""
    x, u, x_next, past_x, past_u = windows(numbered, memory, rows)
    expected = [r for a, b in zip(numbered.bounds, numbered.bounds[1:], strict=False) for r in range(a + memory, b - 1)]
    assert x[:, 0].tolist() == expected
    assert len(x) == Transitions.of(numbered).count(memory)
    back = x[:, :1] - np.arange(1, memory + 1)
    assert (x_next[:, 0] == x[:, 0] + 1).all()
    assert (u[:, 0] == x[:, 0] + 100).all()
    assert (past_x[..., 0] == back).all()
    assert (past_x[..., 1] == -back).all()
    assert (past_u[..., 0] == back + 100).all()


@pytest.mark.parametrize("memory", [0, 2])
def test_spans_put_together_are_the_whole(numbered, memory):
    whole = windows(numbered, memory, 100)
    total = len(whole[0])
    for cut in range(1, total):
        parts = [windows(numbered, memory, 4, slice(*ends)) for ends in ((0, cut), (cut, total))]
        for a, b, both in zip(*parts, whole, strict=True):
            assert (np.concatenate([a, b]) == both).all()


def test_short_episodes_are_read_together_and_no_more_rows_than_asked_for():
    class Read:
        def __init__(self, values):
            self.values, self.shape, self.dtype, self.read = values, values.shape, values.dtype, []

        def __getitem__(self, rows):
            self.read.append(rows.stop - rows.start)
            return self.values[rows]

    data = episodes_of([np.ones((4, 1))] * 1000, [np.ones((4, 1))] * 1000)
    object.__setattr__(data, "x", Read(data.x))
    assert sum(len(part.x) for part in Transitions.of(data).windows(2, 200)) == 1000
    assert len(data.x.read) <= 25
    assert max(data.x.read) <= 200 + 3


@pytest.mark.parametrize("rows", [1, 4, 100])
def test_trajectories_have_a_past_too(rows):
    x = np.arange(3 * 7.0).reshape(3, 7, 1)
    data = Trajectories(x, 100 + x[:, :-1], 0.1, channels("x", 1), channels("u", 1))
    now, u, then, past_x, past_u = windows(data, 2, rows)
    assert now[:, 0].tolist() == [2, 3, 4, 5, 9, 10, 11, 12, 16, 17, 18, 19]
    assert (then == now + 1).all()
    assert (u == now + 100).all()
    assert (past_x[..., 0] == now - [1, 2]).all()
    assert (past_u[..., 0] == now + 100 - [1, 2]).all()


def test_several_records_are_one_after_another(numbered):
    both = Transitions.of([numbered, numbered])
    assert len(both) == 2 * len(Transitions.of(numbered)) == 40
    assert both.product is None
    assert both.plant == {}
    assert both.longest == 12
    other = episodes_of([np.ones((3, 2))], [np.ones((3, 1))], dt=0.2)
    with pytest.raises(InvalidValueError, match="differ in their sampling period"):
        Transitions.of([numbered, other])
