"""Whole selections: verdicts on systems that are known, what is refused, and what changes nothing."""

from __future__ import annotations

import numpy as np
import pytest

from koopcli.errors import InvalidValueError
from koopcli.koopman.selection.blocks import Holding, folds, pieces_of
from koopcli.koopman.selection.choice import DEFAULT
from koopcli.koopman.selection.drive import beyond, explained, outside
from koopcli.koopman.selection.record import LEVELS, Selection
from koopcli.koopman.selection.regress import Rung
from koopcli.koopman.selection.select import judged, select
from koopcli.koopman.selection.sentences import is_predicted
from koopcli.koopman.selection.verdict import Block
from tests.koopman.selection.logs import bilinear, delayed, log, smooth_inputs

KEYS = ["chosen_rung", "verdict", "ratio_to_dmdc", "ratio_to_hold", "per_state", "blocks"]
KEYS += ["outside_share", "limited_share"]


@pytest.fixture(scope="module")
def of_delayed() -> Selection:
    return select(log(*delayed()))


@pytest.fixture(scope="module")
def of_bilinear() -> Selection:
    x, u = bilinear()
    noise = 0.002 * np.random.default_rng(7).normal(size=x.shape)
    return select(log(x + noise, u))


def test_a_linear_system_with_delays_is_predicted_almost_exactly_by_the_linear_rung(of_delayed: Selection) -> None:
    assert of_delayed.chosen_rung == "linear, 0.2 s"
    assert of_delayed.picked.tolist() == [0, 0, 0]
    assert of_delayed.ratio("chosen", "dmdc") < 0.05
    assert of_delayed.ratio("chosen", "hold") < 0.02
    assert of_delayed.verdict.startswith("Yes: x0 within")


def test_a_bilinear_system_is_predicted_by_products(of_bilinear: Selection) -> None:
    assert of_bilinear.chosen_rung == "products, 0.2 s"
    assert of_bilinear.picked.tolist() == [1, 1, 1]
    assert of_bilinear.ratio("chosen", "dmdc") < 0.4


def test_the_figures_are_json_with_these_keys(of_bilinear: Selection) -> None:
    import json

    figures = json.loads(json.dumps(of_bilinear.figures(), allow_nan=False))
    assert list(figures) == KEYS
    assert list(figures["per_state"]) == ["x0", "x1"]
    assert list(figures["per_state"]["x0"]) == ["0.25", "0.5", "1"]
    assert set(figures["per_state"]["x1"]["0.5"]) == {"rmse", "to_hold", "to_dmdc"}
    assert [set(block) for block in figures["blocks"]] == [{"picked", "ratio_to_dmdc"}] * 3
    assert figures["blocks"][0]["picked"] == "products, 0.2 s"
    shown = [cell["to_dmdc"] for state in figures["per_state"].values() for cell in state.values()]
    assert figures["ratio_to_dmdc"] == pytest.approx(np.exp(np.log(shown).mean()))


def test_errors_are_pooled_over_windows_and_quantiles_are_ordered(of_bilinear: Selection) -> None:
    chosen = of_bilinear.models.index("chosen")
    squares = of_bilinear.errors[chosen] ** 2 * of_bilinear.windows[:, None, None]
    np.testing.assert_allclose(of_bilinear.pooled("chosen") ** 2, squares.sum(axis=0) / of_bilinear.windows.sum())
    assert of_bilinear.quantiles.shape == (len(LEVELS), 20, 2)
    assert (np.diff(of_bilinear.quantiles, axis=0) >= 0).all()
    low, high = of_bilinear.span("chosen")
    assert (low <= of_bilinear.pooled("chosen")).all()
    assert (of_bilinear.pooled("chosen") <= high).all()


def test_the_record_comes_back_as_it_was(of_delayed: Selection) -> None:
    assert Selection.unpack(of_delayed.pack()) == of_delayed
    assert "linear, 0.2 s of 2 rungs" in repr(of_delayed)


def test_white_noise_is_not_predicted() -> None:
    noise = np.random.default_rng(3).normal(size=(2400, 2))
    verdict = select(log(noise, smooth_inputs(2400, 1, 4))).verdict
    assert verdict.startswith("No: x0 not predicted, no better than its mean: nothing among the inputs drives it")
    assert "Record what drives x0 and x1, or make them inputs." in verdict


def test_a_random_walk_is_not_predicted() -> None:
    walk = np.cumsum(np.random.default_rng(3).normal(size=(2400, 1)), axis=0)
    assert "no better than" in select(log(walk, smooth_inputs(2400, 1, 4))).verdict


def test_a_state_that_is_worth_more_than_its_mean_for_a_moment_alone_is_predicted() -> None:
    x, u = bilinear()
    quick = np.zeros((len(x), 1))
    noise = np.random.default_rng(8).normal(size=len(x))
    for k in range(len(x) - 1):
        quick[k + 1] = 0.9 * quick[k] + noise[k]
    selection = select(log(np.concatenate([x, quick], axis=1), u))
    assert selection.ratios("chosen", "mean")[2, 2] > 0.95
    assert is_predicted(selection) == [True, True, True]


def test_one_state_of_three_that_nothing_drives_is_named() -> None:
    x, u = delayed()
    walk = np.cumsum(np.random.default_rng(3).normal(size=(2400, 1)), axis=0)
    verdict = select(log(np.concatenate([x, walk], axis=1), u)).verdict
    assert verdict.startswith("In part: x0 within")
    assert "x2 not predicted, no better than" in verdict
    assert "Record what drives x2" in verdict


@pytest.mark.parametrize("scale", [np.array([3.6, -57.3]), np.array([-1e-4, 1e5])])
def test_scale_and_sign_of_units_change_no_ratio(scale: np.ndarray, of_bilinear: Selection) -> None:
    x, u = bilinear()
    noise = 0.002 * np.random.default_rng(7).normal(size=x.shape)
    scaled = select(log((x + noise) * scale, u * scale[::-1]))
    for reference in ("hold", "dmdc", "mean"):
        np.testing.assert_allclose(
            scaled.ratios("chosen", reference), of_bilinear.ratios("chosen", reference), rtol=1e-6
        )
    np.testing.assert_allclose(scaled.gain, of_bilinear.gain, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(scaled.use, of_bilinear.use)
    assert scaled.outside_share == of_bilinear.outside_share


def test_a_log_shorter_than_three_windows_is_refused() -> None:
    x, u = delayed(84)
    with pytest.raises(InvalidValueError, match=r"the log is too short: block 1 of 3 has no window of 1\.4 s") as error:
        select(log(x, u))
    assert "\n" not in str(error.value)


def test_a_log_of_episodes_too_short_for_a_window_is_refused() -> None:
    x, u = delayed(1000)
    with pytest.raises(InvalidValueError, match="record more without interruption"):
        select(log(x, u, [25] * 40))


def test_states_that_never_move_are_refused() -> None:
    x, u = delayed()
    x[:, 1] = 0.3
    with pytest.raises(InvalidValueError, match=r"state x1 never changes, it is 0\.3 in all 2400 rows") as error:
        select(log(x, u))
    assert "\n" not in str(error.value)


def test_states_that_are_not_numbers_are_refused() -> None:
    x, u = delayed()
    x[7, 0] = np.nan
    with pytest.raises(InvalidValueError, match="state x0 has values that are not numbers"):
        select(log(x, u))


def test_inputs_that_never_move_are_said() -> None:
    x, u = delayed()
    still = np.concatenate([u, np.full((len(u), 1), 0.1)], axis=1)
    selection = select(log(x, still, inputs=("a", "b", "brake")))
    assert np.isnan(selection.use[2])
    assert "brake never moves: record drives in which it does." in selection.verdict


def test_an_input_used_in_one_block_alone_is_said() -> None:
    x, u = delayed()
    brake = np.zeros((len(u), 1))
    brake[:, 0] = 0.01 * np.sin(np.arange(len(u)))
    brake[900:1000] = 1.0
    selection = select(log(x, np.concatenate([u, brake], axis=1), inputs=("a", "b", "brake")))
    assert selection.use[2] == pytest.approx(1.01 / 0.02, rel=0.01)
    assert "brake is hardly used: in one block it moves 51 times as far as in all others" in selection.verdict
    assert selection.limited_share >= 100 / 2400


def test_a_short_log_is_judged_but_compares_no_rungs() -> None:
    selection = select(log(*delayed(120)))
    assert selection.blind
    assert "too short to compare rungs" in selection.verdict


def test_a_ladder_and_more_blocks_can_be_asked_for() -> None:
    ladder = (Rung(0.0), Rung(0.2), Rung(0.6))
    selection = select(log(*delayed()), ladder, outer=5)
    assert selection.errors.shape == (4, 5, 20, 2)
    assert selection.chosen_rung in ("linear, 0.2 s", "linear, 0.6 s")


def test_runs_are_dealt_out() -> None:
    selection = select(log(*delayed(), [200] * 12, list(range(12))))
    assert selection.ratio("chosen", "dmdc") < 0.1


def test_blocks_judged_elsewhere_give_the_same(of_delayed: Selection) -> None:
    episodes = log(*delayed())
    blocks = [Block.unpack(judged(episodes, DEFAULT, 3, False, i).pack()) for i in range(3)]
    assert select(episodes, blocks=blocks) == of_delayed


def test_a_log_without_inputs_is_selected_for() -> None:
    x, _ = delayed()
    selection = select(log(x, np.empty((len(x), 0))))
    assert selection.use.shape == (0,)
    assert selection.limited_share == 0.0


def test_the_mean_input_explains_what_it_drives_and_nothing_else() -> None:
    u = smooth_inputs(4000, 1, 9, keep=0.98)
    driven = np.cumsum(0.05 * u, axis=0)
    other = np.random.default_rng(1).normal(size=(4000, 1)).cumsum(axis=0)
    gain = explained(np.concatenate([driven, other], axis=1), u, pieces_of(log(driven, u)), 0.05)
    assert gain[0] > 0.9
    assert gain[1] < 0.02


def test_held_out_rows_outside_the_box_are_counted() -> None:
    x = np.linspace(0.0, 1.0, 2400)[:, None]
    pieces = pieces_of(log(x, np.zeros((2400, 1))))
    cut = folds(pieces, 3, Holding.of(pieces, 0.05))
    assert [outside(x, fold).mean() for fold in cut] == [1.0, 0.0, 1.0]
    np.testing.assert_allclose(beyond(x, cut), [800 / 1560], rtol=0.01)


def test_selection_changes_no_row() -> None:
    x, u = delayed()
    episodes = log(x.copy(), u.copy())
    select(episodes)
    assert episodes == log(x, u)
