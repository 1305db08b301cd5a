from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import ClassVar, Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from koopcli.checks import Layer, Settings, build, check_choice, choose, from_file, restored
from koopcli.choices import Choice, names_of, setting, taken_from, told, written
from koopcli.errors import InvalidValueError, KoopError, MisplacedError, UsageError


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


# --- choices among kinds with settings of their own


class Corner(Choice):
    pass


@dataclass(frozen=True)
class Sharp(Corner):
    """No radius."""

    kind: ClassVar[str] = "sharp"


@dataclass(frozen=True)
class Round(Corner):
    """One radius."""

    kind: ClassVar[str] = "round"
    radius: float = setting(2.0, above=0)


class Shape(Choice):
    pass


@dataclass(frozen=True)
class Ball(Shape):
    """As far in every direction."""

    kind: ClassVar[str] = "ball"
    size: float = setting(1.0, above=0)


@dataclass(frozen=True, kw_only=True)
class Box(Shape):
    """With corners."""

    kind: ClassVar[str] = "box"
    size: float = setting(3.0, above=0)
    corner: Corner = setting(Sharp())
    owner: str = taken_from("person")


@dataclass(frozen=True)
class Thing(Settings):
    shape: Shape = setting(Ball())
    count: int = setting(1, low=1)


OF_SHAPES = Shape.kinds()


def thing(*layers, usual="ball"):
    layers = [Layer(values) for values in layers]
    return choose(OF_SHAPES, layers, usual, "thing.", "shape", {"owner": "me"})


def test_a_setting_stands_beside_the_choice_that_has_it():
    assert Thing.of(size=5, count=2) == Thing(Ball(5.0), 2)
    assert names_of(Thing) == ("shape", "count", "size", "corner", "radius")
    assert written(Thing.of(size=5)) == {"shape": "ball", "size": 5.0, "count": 1}
    assert thing({"kind": "box", "corner": "round", "radius": 1}) == Box(corner=Round(1.0), owner="me")


@pytest.mark.parametrize(
    ("layers", "made"),
    [
        (({"size": 4}, {"kind": "box"}), Box(size=4.0, owner="me")),  # both kinds have it
        (
            ({"kind": "box", "corner": "round"}, {"radius": 7}, {"size": 2}),
            Box(size=2.0, corner=Round(7.0), owner="me"),
        ),
        (({"box": {"size": 8}, "ball": {"size": 9}},), Ball(9.0)),  # tables of kinds, in effect or not
        (({"box": {"size": 8}}, {"kind": "box"}), Box(size=8.0, owner="me")),
        (({"ball": {"size": 8}}, {"size": 4}), Ball(4.0)),
        (({"size": 4}, {"ball": {"size": 8}}), Ball(8.0)),  # the later layer wins, however it says it
        (({"kind": "box", "corner": {"kind": "round", "round": {"radius": 5}}},), Box(corner=Round(5.0), owner="me")),
        (({"kind": "box", "corner": "round", "radius": 5}, {"corner": "sharp"}), Box(owner="me")),
        (({"kind": "box", "corner": "round"}, {"kind": "ball"}), Ball()),  # what only the other kind had is left
        (  # the kind stands by its name, its settings in a table of a table
            ({"kind": "box", "corner": "round", "box": {"corner": {"round": {"radius": 5}}}},),
            Box(corner=Round(5.0), owner="me"),
        ),
        (
            ({"kind": "box", "box": {"corner": "round"}, "corner": {"round": {"radius": 5}}},),
            Box(corner=Round(5.0), owner="me"),
        ),
    ],
)
def test_later_layers_win(layers, made):
    assert thing(*layers) == made


def test_where_one_name_means_two_things_a_change_of_kind_starts_afresh(monkeypatch):
    monkeypatch.setattr(Shape, "afresh", True)
    assert thing({"size": 4}, {"kind": "box"}) == Box(owner="me")
    assert thing({"size": 4}, {"kind": "ball", "size": 5}) == Ball(5.0)


def test_a_copy_keeps_what_both_kinds_have_and_is_not_at_its_default():
    assert Thing.of(size=5).but(count=3) == Thing(Ball(5.0), 3)
    assert Thing.of(size=5).but(size=1) == Thing()
    assert Thing.of(count=2).but(size=1) == Thing(count=2)


@pytest.mark.parametrize(
    ("layers", "error", "says"),
    [
        (({"corner": "round"},), MisplacedError, "'thing.corner' belongs to shape 'box', and this shape is 'ball'"),
        (({"kind": "box", "radius": 3},), MisplacedError, "'thing.radius' belongs to corner 'round', and this corner"),
        (({"ball": {"corner": "round"}},), MisplacedError, "'thing.ball.corner' belongs to shape 'box'"),
        (({"kind": "boll"},), UsageError, "'thing' has no kind 'boll': did you mean 'ball'"),
        (({"kind": ["ball"]},), UsageError, "'thing' has no kind"),
        (({"bix": {"size": 1}},), UsageError, "'thing' has no kind 'bix': did you mean 'box'"),
        (({"sise": 3},), UsageError, "unknown setting 'thing.sise': did you mean 'size'"),
        (({"ball": 3},), InvalidValueError, "'thing.ball' must be a table of settings, got 3"),
        (
            ({"ball": {"size": 3}, "size": 4},),
            UsageError,
            "'thing.size' is set twice, as such and in the table 'thing.ball'",
        ),
        (({"box": {"size": 0}},), InvalidValueError, "'thing.box.size' must be above 0"),
        (({"size": 0}, {"size": 1}), InvalidValueError, "'thing.size' must be above 0"),
        (({"kind": "box", "owner": "you"},), UsageError, "'thing.owner' is the simulation's: set person.owner"),
    ],
)
def test_what_no_kind_in_effect_has_is_refused(layers, error, says):
    with pytest.raises(error, match=re.escape(says)):
        thing(*layers)
    with pytest.raises(InvalidValueError, match=r"mine\.toml"):
        choose(OF_SHAPES, [Layer(v, from_file("mine.toml")) for v in layers], "ball", "thing.", "shape", {"owner": ""})


def test_where_the_kind_is_not_known_yet_any_kind_may_have_a_setting():
    for values in ({"size": 3}, {"corner": "round"}, {"box": {"size": 3}}):
        check_choice(OF_SHAPES, [Layer(values)], None, "thing.", "shape")
    for values in ({"sise": 3}, {"size": 0}, {"corner": "flat"}):
        with pytest.raises(KoopError):
            check_choice(OF_SHAPES, [Layer(values)], None, "thing.", "shape")


def test_near_names_come_from_all_kinds_while_none_is_known():
    with pytest.raises(
        UsageError, match=re.escape("'thing.cornr': did you mean 'corner'? (known: size, corner, radius)")
    ):
        check_choice(OF_SHAPES, [Layer({"cornr": 1})], None, "thing.", "shape")


def test_an_instance_stands_for_its_kind_with_all_its_settings():
    assert Thing.of(shape=Ball(4.0)).but(shape=Ball()) == Thing()
    for values in ({"shape": Ball(4.0), "size": 5}, {"shape": Sharp()}):
        with pytest.raises(UsageError):
            Thing.of(**values)


def test_the_default_of_a_choice_has_its_own_defaults():
    with pytest.raises(TypeError, match="its own defaults"):
        setting(Ball(2.0))


def test_a_choice_left_open_is_restored():
    @dataclass(frozen=True)
    class Open:
        shape: Shape | None = setting(None)

    globals()["Open"] = Open  # where type hints are looked up
    assert restored(Open, written(Open())) == Open()


@given(st.sampled_from(["ball", "box"]), st.floats(0.1, 10), st.none() | st.floats(0.1, 10))
def test_written_and_restored_it_is_the_same(kind, size, radius):
    round_ = {} if radius is None or kind == "ball" else {"corner": "round", "radius": radius}
    made = thing({"kind": kind, "size": size, **round_})
    assert restored(Shape, written(made)) == made
    assert thing(told(made), usual=kind) == made
