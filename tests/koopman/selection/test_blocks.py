"""Blocks partition the rows, and neither a training row nor a window comes where it must not."""

from __future__ import annotations

import numpy as np
import pytest

from koopcli.errors import InvalidValueError
from koopcli.koopman.selection.blocks import Fold, Holding, Piece, Pieces, folds, pieces_of, row_numbers, rows_of
from koopcli.koopman.selection.regress import pair_rows
from koopcli.koopman.selection.windows import Windows, ahead_of, nearest, rmse
from tests.koopman.selection.logs import log, smooth_inputs

DT = 0.05
LENGTHS = [400, 37, 900, 120, 260]


def pieces(lengths: list[int], runs: list[int] | None = None) -> Pieces:
    rows = sum(lengths)
    return pieces_of(log(smooth_inputs(rows, 1, 0), np.zeros((rows, 1)), lengths, runs, DT))


def both(
    lengths: list[int] = LENGTHS, runs: list[int] | None = None, count: int = 3
) -> tuple[Pieces, tuple[Fold, ...]]:
    whole = pieces(lengths, runs)
    return whole, folds(whole, count, Holding.of(whole, DT))


@pytest.mark.parametrize("count", [2, 3, 4, 7])
def test_blocks_partition_the_rows_into_equal_parts(count: int) -> None:
    whole, cut = both(count=count)
    held = [row_numbers(fold.held) for fold in cut]
    np.testing.assert_array_equal(np.concatenate(held), row_numbers(whole))
    assert {len(rows) for rows in held} <= {rows_of(whole) // count, rows_of(whole) // count + 1}


def test_training_rows_keep_two_seconds_away_from_the_block_within_its_episode() -> None:
    whole, cut = both()
    for fold in cut:
        held, training = row_numbers(fold.held), row_numbers(fold.training)
        for piece in whole:
            of_piece = np.arange(piece.start, piece.stop)
            near = np.intersect1d(held, of_piece)
            left = np.intersect1d(training, of_piece)
            if len(near) and len(left):
                assert np.abs(left[:, None] - near[None]).min() == 41
            elif not len(near):
                assert len(left) == len(of_piece)


def test_short_logs_lose_half_a_second_at_each_block() -> None:
    assert Holding.of(pieces([1399]), DT) == Holding(dealt=False, margin=10)
    assert Holding.of(pieces([1400]), DT) == Holding(dealt=False, margin=40)


def test_from_twelve_runs_on_whole_runs_are_dealt_out_in_turn() -> None:
    runs = [i // 2 for i in range(24)]
    _, cut = both([30] * 24, runs)
    for i, fold in enumerate(cut):
        assert {piece.run for piece in fold.held} == {run for run in range(12) if run % 3 == i}
        assert {piece.run for piece in fold.training} == {run for run in range(12) if run % 3 != i}
        assert all(len(piece) == 30 for piece in fold.training + fold.held)


def test_eleven_runs_are_not_dealt_out() -> None:
    assert not Holding.of(pieces([30] * 11, list(range(11))), DT).dealt


def test_blocks_within_blocks_see_no_row_of_the_outer_one() -> None:
    whole, cut = both()
    for outer in cut:
        for inner in folds(outer.training, 4, Holding.of(whole, DT)):
            seen = np.concatenate([row_numbers(inner.training), row_numbers(inner.held)])
            assert not np.intersect1d(seen, row_numbers(outer.held)).size
            assert not np.intersect1d(row_numbers(inner.training), row_numbers(inner.held)).size


def test_fewer_rows_or_runs_than_blocks_are_refused() -> None:
    with pytest.raises(InvalidValueError, match="2 rows do not make 3 blocks"):
        folds((Piece(0, 2, 0),), 3, Holding(dealt=False, margin=1))
    with pytest.raises(InvalidValueError, match="12 runs do not make 13 blocks"):
        both([30] * 12, list(range(12)), 13)
    with pytest.raises(InvalidValueError, match="ask for two or more"):
        both(count=1)


@pytest.mark.parametrize("memory", [0.0, 0.2, 0.7])
def test_no_window_and_no_pair_crosses_a_seam(memory: float) -> None:
    whole, cut = both()
    episode = np.repeat(np.arange(len(whole)), [len(piece) for piece in whole])
    windows = Windows.of(DT, memory)
    assert windows.history == max(8, round(memory / DT))
    for fold in cut:
        block = set(row_numbers(fold.held).tolist())
        starts = windows.starts(fold.held, 0.3)
        for start in starts.tolist():
            rows = range(start - windows.history, start + windows.ahead + 1)
            assert block.issuperset(rows)
            assert len({episode[row] for row in rows}) == 1
        past = round(memory / DT)
        pairs = pair_rows(fold.training, past)
        training = set(row_numbers(fold.training).tolist())
        for first, last in zip((pairs - past).tolist(), (pairs + 1).tolist(), strict=True):
            assert training.issuperset(range(first, last + 1))
            assert episode[first] == episode[last]


def test_windows_start_after_their_history_and_at_the_given_distance() -> None:
    windows = Windows.of(DT, 0.2)
    starts = windows.starts((Piece(100, 171, 0), Piece(200, 210, 0)), 0.6)
    np.testing.assert_array_equal(starts, [108, 120, 132, 144])
    assert windows.horizons == {0.25: 5, 0.5: 10, 1.0: 20}
    assert windows.length == pytest.approx(1.4)
    assert len(windows.starts((), 0.3)) == 0


def test_the_nearest_step_is_at_least_one() -> None:
    assert [nearest(time, 0.04) for time in (0.25, 0.5, 1.0, 0.001)] == [6, 12, 25, 1]


def test_what_lies_ahead_and_its_error() -> None:
    values = np.arange(20.0).reshape(10, 2)
    truth = ahead_of(values, np.array([0, 4]), 3)
    np.testing.assert_array_equal(truth[1], values[5:8])
    np.testing.assert_allclose(rmse(np.array([[[3.0]], [[4.0]]])), [[np.sqrt(12.5)]])
