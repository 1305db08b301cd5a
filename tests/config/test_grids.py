from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from koopcli.config.grids import MOST, parse_grid, split, text_of
from koopcli.errors import InvalidValueError, UsageError


def values(text):
    grid = parse_grid([f"fit-edmd.order={text}"])
    return list(grid.axes[0].values) if grid.axes else [grid.fixed[0][1]]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("7", [7]),
        ("1:4", [1, 2, 3, 4]),
        ("1:10:3", [1, 4, 7, 10]),
        ("1:9:3", [1, 4, 7]),
        ("3:1:-1", [3, 2, 1]),
        ("1:3,7, 9:10", [1, 2, 3, 7, 9, 10]),
        ("0:0.3:0.1", [0.0, 0.1, 0.2, 0.3]),
        ("-1e-3:1e-3:1e-3", [-1e-3, 0.0, 1e-3]),
        ("1e-6,1e-4,0", [1e-6, 1e-4, 0]),
        ("linear,bilinear", ["linear", "bilinear"]),
        ("true,false", [True, False]),
        ("[20, 20, 5],[30,30,10]", [[20, 20, 5], [30, 30, 10]]),
        ('"a,b",c', ["a,b", "c"]),
        ("./a:b.toml,c.toml", ["./a:b.toml", "c.toml"]),
    ],
)
def test_values_and_ranges(text, expected):
    found = values(text)
    assert found == expected
    assert list(map(type, found)) == list(map(type, expected))


@pytest.mark.parametrize("text", ["1:", ":3", "a:b"])
def test_what_only_looks_like_a_range_is_text(text):
    assert values(text) == [text]


@pytest.mark.parametrize(
    ("text", "error", "words"),
    [
        ("5:1", InvalidValueError, "both ends included"),
        ("1:5:0", InvalidValueError, "both ends included"),
        ("1:1e9", InvalidValueError, "at most"),
        ("1,,2", UsageError, "missing"),
        ("1,", UsageError, "missing"),
        ("", UsageError, "missing"),
        ("1:3,2", InvalidValueError, "value 2 stands there twice"),
        ("0.5,1:2,1.0", InvalidValueError, "value 1 stands there twice"),
    ],
)
def test_odd_values_are_refused(text, error, words):
    with pytest.raises(error, match=words):
        values(text)


def test_names_are_those_of_any_command():
    with pytest.raises(UsageError, match="unknown stage 'fit-edm'"):
        parse_grid(["fit-edm.order=1:3"])
    with pytest.raises(UsageError, match="given twice"):
        parse_grid(["fit-edmd.order=1:3", "fit-edmd.order=5"])
    with pytest.raises(InvalidValueError, match=f"more than {MOST:,}"):
        parse_grid(["fit-edmd.order=1:1000", "sample.seed=0:999"])


def test_the_last_axis_runs_fastest():
    grid = parse_grid(["fit-edmd.order=1:2", "vehicle.Jzz=1731", "fit-edmd.terms=linear,bilinear"])
    assert len(grid) == 4
    places = [place for place, _ in grid.cells()]
    assert places == [(0, 0), (0, 1), (1, 0), (1, 1)]
    for place, settings in grid.cells():
        assert dict(settings) == {
            "vehicle.Jzz": 1731,
            "fit-edmd.order": place[0] + 1,
            "fit-edmd.terms": ("linear", "bilinear")[place[1]],
        }


@given(st.lists(st.text("ab1.:", min_size=1), min_size=1))
def test_splitting_undoes_joining(words):
    assert split(",".join(words)) == words


@given(st.floats(allow_nan=False, allow_infinity=False, width=32))
def test_a_number_is_written_so_that_it_reads_the_same(value):
    assert float(text_of(value)) == value


def test_whole_numbers_of_any_size_stay_what_they_are():
    assert values(f"{2**62}:{2**62 + 2}") == [2**62, 2**62 + 1, 2**62 + 2]
