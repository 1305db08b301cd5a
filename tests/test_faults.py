"""Nothing that was committed is lost, and no damage is taken for good. At length: ``make faults``."""

from __future__ import annotations

import errno

import pytest

from tests.faults import damage, errors, kills
from tests.powercut import commands


@pytest.mark.slow
@pytest.mark.parametrize("writers", [1, 2])
def test_killed_writers_lose_nothing(tmp_path, writers):
    count = kills(tmp_path, 10, writers, seed=writers)
    assert count.struck >= 6
    assert (count.lost, count.accepted) == (0, 0)


SELDOM = [pytest.param(code, marks=pytest.mark.slow) for code in (errno.EDQUOT, errno.EROFS, errno.EACCES)]


@pytest.mark.parametrize("code", [errno.EIO, errno.ENOSPC, *SELDOM])
def test_an_error_at_any_call_of_a_commit_leaves_the_old_state_or_the_new(tmp_path, code):
    count = errors(tmp_path, code)
    assert count.struck == count.injected >= 20
    assert (count.lost, count.accepted) == (0, 0)


@pytest.mark.parametrize("which", [0, 1], ids=["small", "large"])
def test_every_flipped_bit_and_every_cut_is_found(tmp_path, which):
    flipped, cut = damage(tmp_path, 300, 200, which)
    assert (flipped.injected, flipped.struck, flipped.accepted) == (300, 300, 0)
    assert (cut.injected, cut.struck, cut.accepted) == (200, 200, 0)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["pin", "gc --delete"])
def test_a_power_cut_during_a_command_loses_nothing(name):
    """Others: `make faults`. Power cuts of the store alone: tests/store/test_powercut.py."""
    total = commands.count(name)
    assert total["states"] > 100
    assert (total["lost"], total["wrong"]) == (0, 0)
