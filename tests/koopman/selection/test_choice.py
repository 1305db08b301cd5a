"""The rule that chooses a rung, on scores by hand and on systems of a known kind."""

from __future__ import annotations

import numpy as np
import pytest

from koopcli.koopman.selection.blocks import Holding, Piece, folds
from koopcli.koopman.selection.choice import BLOCKS, DEFAULT, choose, inner_scores, pick
from koopcli.koopman.selection.regress import Rung, fit
from koopcli.koopman.selection.windows import Windows
from tests.koopman.selection.logs import bilinear, delayed

DT = 0.05
WINDOWS = Windows.of(DT, 0.2)


@pytest.mark.parametrize(
    ("ratios", "picked"),
    [
        ([0.9, 0.9, 0.9, 0.9], 1),
        ([1.04, 0.9, 0.9, 0.9], 1),
        ([1.06, 0.5, 0.5, 0.5], 0),
        ([1.04, 1.04, 0.97, 0.97], 0),
        ([1.0, 1.0, 1.0, 1.0], 0),
    ],
)
def test_products_are_taken_where_lower_on_average_and_safe_in_every_block(ratios: list[float], picked: int) -> None:
    linear = np.array([0.3, -2.0, 1.0, 0.0])
    assert pick(np.stack([linear, linear + np.log(ratios)])) == picked


def test_of_a_longer_ladder_the_best_of_the_safe_rungs_is_taken() -> None:
    ratios = np.array([[1.0, 1.0], [0.9, 0.8], [0.7, 0.9], [1.2, 0.1]])
    assert pick(np.log(ratios)) == 2


def test_scores_are_the_mean_log_errors_at_the_horizons() -> None:
    x, u = bilinear()
    pieces = (Piece(0, len(x), 0),)
    holding = Holding.of(pieces, DT)
    fold = folds(pieces, BLOCKS, holding)[2]
    starts = WINDOWS.starts(fold.held, 0.6)
    forecast = fit(x, u, fold.training, DEFAULT[1], DT).predict(x, u, starts, 20)
    logs = [
        np.log(np.sqrt(np.mean([(forecast[w, k - 1, i] - x[start + k, i]) ** 2 for w, start in enumerate(starts)])))
        for k in (5, 10, 20)
        for i in range(2)
    ]
    assert inner_scores(x, u, pieces, DEFAULT, WINDOWS, holding)[1, 2] == pytest.approx(np.mean(logs))


@pytest.mark.parametrize(("make", "picked"), [(delayed, 0), (bilinear, 1)])
def test_a_linear_system_is_predicted_by_the_linear_rung_and_a_bilinear_one_by_products(make, picked: int) -> None:
    x, u = make()
    pieces = (Piece(0, len(x), 0),)
    noisy = x + 0.002 * np.random.default_rng(5).normal(size=x.shape)
    choice = choose(noisy, u, pieces, DEFAULT, WINDOWS, Holding.of(pieces, DT))
    assert choice.picked == picked
    assert choice.scores.shape == (2, 4)
    assert not choice.blind


def test_a_ladder_finds_the_memory_that_a_system_has() -> None:
    x, u = delayed()
    pieces = (Piece(0, len(x), 0),)
    ladder = (Rung(0.0), Rung(0.1), Rung(0.2), Rung(0.2, True))
    assert choose(x, u, pieces, ladder, WINDOWS, Holding.of(pieces, DT)).picked == 2


def test_without_a_window_in_the_inner_blocks_nothing_is_compared() -> None:
    x, u = bilinear(100)
    pieces = (Piece(0, 100, 0),)
    choice = choose(x, u, pieces, DEFAULT, WINDOWS, Holding.of(pieces, DT))
    assert choice.blind
    assert choice.picked == 0
    assert np.isnan(choice.scores).all()
