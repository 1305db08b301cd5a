from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from koopcli.checks import build, from_file, setting
from koopcli.errors import InvalidValueError, UsageError


@dataclass(frozen=True)
class Example:
    count: int = setting(3, low=1, high=9)
    width: float = setting(1.0, above=0, unit="m")
    kind: Literal["a", "b"] = "a"
    levels: tuple[float, ...] = setting((1.0,), low=0)
    limit: int | None = setting(None, low=0)


def test_values_take_their_declared_type():
    made = build(Example, {"count": 2.0, "width": 2, "levels": [1, 2]})
    assert made == Example(count=2, width=2.0, levels=(1.0, 2.0))
    assert type(made.count) is int
    assert type(made.width) is float
    assert all(type(v) is float for v in made.levels)


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({"count": 0}, "at least 1"),
        ({"count": 10}, "at most 9"),
        ({"count": 1.5}, "a whole number"),
        ({"count": True}, "a whole number"),
        ({"width": 0.0}, "above 0 m"),
        ({"width": math.nan}, "finite"),
        ({"width": math.inf}, "finite"),
        ({"width": "1"}, "a number"),
        ({"levels": []}, "non-empty list"),
        ({"levels": [1.0, -1.0]}, r"levels\[1\]"),
        ({"limit": -1}, "at least 0"),
    ],
)
def test_values_out_of_range_are_refused(values, says):
    with pytest.raises(InvalidValueError, match=says):
        build(Example, values)


def test_wrong_names_cost_what_their_origin_says():
    for values in ({"cuont": 1}, {"kind": "c"}):
        with pytest.raises(UsageError):
            build(Example, values)
        with pytest.raises(InvalidValueError, match=r"mine\.toml"):
            build(Example, values, from_file("mine.toml"))


def test_unknown_names_get_the_nearest_candidate():
    with pytest.raises(UsageError, match="did you mean 'count'"):
        build(Example, {"cuont": 1})


ANYTHING = st.one_of(
    st.none(), st.booleans(), st.text(), st.floats(), st.lists(st.integers()), st.dictionaries(st.text(), st.none())
)


@given(ANYTHING)
def test_any_value_is_taken_or_refused_by_name(value):
    if type(value) is float and math.isfinite(value) and value > 0:
        assert build(Example, {"width": value}).width == value
    else:
        with pytest.raises(InvalidValueError, match="'width'"):
            build(Example, {"width": value})
