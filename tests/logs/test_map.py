"""The map: what it says, what it refuses, and when two maps are the same."""

import json

import numpy as np
import pytest

from koopcli.errors import InvalidValueError
from koopcli.logs.entries import Condition, Time
from koopcli.logs.map import essential_map, parse_map
from koopcli.logs.units import UNITS, known, unit

MAP = """
log = { dt = 0.04, gap = 0.3, keep = "v_x > 3.6 km/h and steer <= 10 deg" }
vehicle = { wheelbase = 0.32 }
[source.imu]
file = "imu.csv"
time = { s = "s", ns = "ns" }
[source.odom]
file = "odom.csv"
time = { column = "t", unit = "ms" }
[states]
v_x = { source = "odom", column = "vx", unit = "kmph" }
yaw_rate = { source = "imu", column = "wz", unit = "deg/s", sign = -1, smooth = 5 }
[inputs]
steer = { source = "odom", column = "delta", ratio = 15, hold = "last" }
"""


def test_a_map_is_read_in_full() -> None:
    log_map = parse_map(MAP)
    v_x, yaw_rate, steer = log_map.signals
    assert (log_map.dt, log_map.gap, log_map.shortest, log_map.wheelbase) == (0.04, 0.3, 2.5, 0.32)
    assert (v_x.columns, v_x.unit, yaw_rate.sign, yaw_rate.smooth) == (("vx",), "km/h", -1.0, 5)
    assert (steer.ratio, steer.hold, steer.unit) == (15.0, "last", None)
    assert log_map.sources[1].time == Time(column="t", unit="ms")
    assert log_map.keep[0] == Condition("v_x", ">", pytest.approx(1.0), "km/h")
    assert log_map.keep[1] == Condition("steer", "<=", pytest.approx(np.pi / 18), "deg")


def test_defaults_are_those_of_the_rule() -> None:
    log_map = parse_map('[states]\nv_x = "vx"\n')
    assert (log_map.dt, log_map.gap, log_map.shortest, log_map.keep, log_map.wheelbase) == (None, 0.3, 2.5, (), None)
    assert log_map.sources[0].time == Time()


def test_an_axis_has_a_sign_and_a_state_can_be_exogenous() -> None:
    log_map = parse_map(
        'exogenous = ["v_x"]\nruns = "run_*"\n'
        '[states]\nv_x = { column = 1 }\nyaw_rate = { column = "w", axis = "-z" }\n'
    )
    assert (log_map.states[1].axis, log_map.states[1].sign) == (2, -1.0)
    assert (log_map.exogenous, log_map.runs) == (("v_x",), "run_*")


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("wheelbase", "weelbase", "did you mean 'wheelbase'"),
        ("gap = 0.3", "gap = -1", "log.gap is -1: a number above 0 was expected"),
        ('source = "imu"', 'source = "imo"', "no source 'imo' in the map: did you mean 'imu'"),
        ('"deg/s"', '"deg/h"', "'deg/h' is no unit that is known: write deg/s"),
        ('"deg/s"', '"m/s"', "states.yaw_rate.unit is 'm/s': a unit such as rad/s was expected"),
        ("sign = -1", "sign = 2", "sign is 2: 1 or -1"),
        ("smooth = 5", "smooth = 0", "smooth is 0: a whole number of at least 1"),
        ("smooth", "smoth", "states.yaw_rate has no key 'smoth': did you mean 'smooth'"),
        ('hold = "last"', 'hold = "first"', "'mean' or 'last' was expected"),
        ("ratio = 15", "ratio = 0", "ratio is 0"),
        ('"delta"', '"vx"', "one column is mapped as v_x and as steer"),
        ("steer =", "v_x =", "two columns are mapped to v_x"),
        ('s = "s", ns = "ns"', 'ns = "ns"', "has 'ns' without 's'"),
        ('column = "t", unit = "ms"', "column = 0, rate = 5", "one of column + unit"),
        ('column = "t", unit = "ms"', 'column = "t", unit = "m"', "s, ms, us or ns was expected"),
        ("v_x > 3.6 km/h", "v_y > 3.6 km/h", "'v_y', which is no signal: did you mean 'v_x'"),
        ("v_x > 3.6 km/h", "v_x is fast", "a comparison such as v_x > 0.3 m/s was expected"),
        ("v_x > 3.6 km/h", "v_x > 3.6 deg", "log.keep has v_x in 'deg'"),
        ("[states]", "[state]", "the map has no key 'state': did you mean 'states'"),
        ("yaw_rate =", "yaw_rate ", "the map is no TOML"),
        ("smooth = 5", "width = 0.1", 'width without from = "heading"'),
        ("smooth = 5", "lever = 0.4", "only v_y or side_slip"),
    ],
)
def test_what_is_wrong_is_refused_in_one_line_with_near_names(old: str, new: str, text: str) -> None:
    with pytest.raises(InvalidValueError) as error:
        parse_map(MAP.replace(old, new, 1))
    assert text in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("text", "refusal"),
    [
        ('[inputs]\nsteer = "d"\n', "the map has no states"),
        ("[states]\nv_x = 0\n", "has no time and so takes column 0"),
        ('[states]\nv_x = "v"\nv_y = "y"\nside_slip = "b"\n', "two columns are mapped to v_y, as v_y and side_slip"),
        ('[states]\nside_slip = "b"\n', "side_slip needs v_x"),
        ('[states]\nv_x = "v"\nv_y = { column = "y", lever = 1.0 }\n', "v_y needs yaw_rate"),
        ('exogenous = ["v_x"]\n[states]\nv_x = "v"\n', "every state is exogenous"),
        ('exogenous = ["v_z"]\n[states]\nv_x = "v"\n', "'v_z', which is no state: did you mean 'v_x'"),
        ("[states]\nv_x = {}\n", "states.v_x has no column"),
    ],
)
def test_a_map_that_is_not_whole_is_refused(text: str, refusal: str) -> None:
    with pytest.raises(InvalidValueError, match=r".") as error:
        parse_map(text)
    assert refusal in str(error.value)


def test_maps_that_mean_the_same_have_one_key() -> None:
    same = MAP.replace("kmph", "km/h").replace("gap = 0.3, ", "").replace("ratio = 15", "ratio = 15.0, sign = 1")
    same = same.replace("v_x > 3.6 km/h and steer <= 10 deg", "steer <= 10 deg and v_x > 3.6 km/h")
    same += '[source.unused]\nfile = "other.csv"\n'
    key = json.dumps(essential_map(parse_map(MAP)), sort_keys=True)
    assert json.dumps(essential_map(parse_map(same)), sort_keys=True) == key
    for old, new in (
        ("sign = -1", "sign = 1"),
        ("0.32", "0.33"),
        ("3.6 km/h", "3.6 m/s"),
        ("smooth = 5", "smooth = 4"),
    ):
        assert json.dumps(essential_map(parse_map(MAP.replace(old, new))), sort_keys=True) != key


@pytest.mark.parametrize(
    ("text", "factor", "si"),
    [
        ("km/h", 1 / 3.6, "m/s"),
        ("kmph", 1 / 3.6, "m/s"),
        ("m/s^2", 1.0, "m/s²"),
        ("deg/s", np.pi / 180, "rad/s"),
        ("°", np.pi / 180, "rad"),
        ("rpm", 2 * np.pi / 60, "rad/s"),
        ("1/min", 2 * np.pi / 60, "rad/s"),
        ("g", 9.80665, "m/s²"),
        ("bar", 1e5, "Pa"),
        ("kPa", 1e3, "Pa"),
        ("Nm", 1.0, "N m"),
        ("%", 0.01, "1"),
        ("mph", 0.44704, "m/s"),
        ("µs", 1e-6, "s"),
    ],
)
def test_units_have_the_factors_of_si(text: str, factor: float, si: str) -> None:
    assert unit(text).factor == pytest.approx(factor, rel=1e-15)
    assert unit(text).si == si


def test_every_si_unit_is_a_unit_of_factor_one() -> None:
    assert all(UNITS[each.si].factor == 1.0 for each in UNITS.values())
    assert not known("furlong")
    with pytest.raises(InvalidValueError, match="'km/hour' is no unit that is known: write km/h"):
        unit("km/hour")
