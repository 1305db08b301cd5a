"""Numbers line up at their points, and are copied as they are."""

from __future__ import annotations

import re

import pytest

from koopcli.reproduction.columns import aligned, is_numeric
from koopcli.reproduction.texts import number_text, score_text

PADDED = re.compile(r'<span(?: data-l="([^"]*)")?(?: data-r="([^"]*)")?>([^<]*)</span>')


def laid_out(cell):
    """The cell as a reader's eye has it, with its hidden text."""
    return PADDED.sub(lambda found: f"{found[1] or ''}{found[3]}{found[2] or ''}", cell)


def copied(cell):
    return re.sub(r"<[^>]*>", "", cell)


COLUMN = ["3.32 ± 2.2 (2.79)", "0.0572 ± 0.11 (0.0272)", "74.1 ± 38 (78.1)", "–", "diverges", "1.0e-12 ± 2 (1)"]


def test_points_stand_below_one_another():
    shown = [laid_out(cell) for cell in aligned(COLUMN)]
    assert len({len(cell) for cell in shown[:3] + shown[5:]}) == 1
    assert {cell.index("±") for cell in shown[:3]} == {shown[0].index("±")}
    assert {cell.index(".") for cell in shown[:3]} == {2}


def test_what_is_copied_is_what_was_given():
    assert [copied(cell) for cell in aligned(COLUMN)] == COLUMN


def test_cells_are_escaped():
    assert aligned(["1 < 2", "<b>"]) == ["1 &lt; 2", "&lt;b&gt;"]


@pytest.mark.parametrize(
    ("cells", "numeric"),
    [
        (["11.1", "–", "3 375 × 30"], True),
        (["random 0", "even"], False),
        (["–", ""], False),
        (["23 ± 15", "seen, not stated", "–", "“areas with very little data”", "441"], False),
        (["-1", "5.0", "diverges"], True),
    ],
)
def test_columns_of_numbers_are_told_from_those_of_words(cells, numeric):
    assert is_numeric(cells) is numeric


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (3.3, 3, "3.30"),
        (0.00417, 3, "0.00417"),
        (1234.0, 3, "1230"),
        (9.996, 3, "10.0"),
        (37.6, 2, "38"),
        (1e-12, 2, "1.0e-12"),
        (2.5e9, 3, "2.50e+09"),
        (0.0, 3, "0"),
        (float("nan"), 3, "–"),
        (-0.5, 2, "-0.50"),
    ],
)
def test_numbers_have_the_digits_that_are_asked_for(value, digits, text):
    assert number_text(value, digits) == text


def test_a_score_that_is_none_says_so():
    rmse = {"mean": 3.304, "std": 2.17, "median": 2.7, "max": 9.0}
    assert score_text({"rmse": rmse}) == "3.30 ± 2.2 (2.70)"
    assert score_text({"rmse": {**rmse, "mean": float("nan")}}) == "diverges"
    assert score_text(None) == "–"
