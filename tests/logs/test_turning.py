"""Units and signs that turning tells: what is proposed is what mends, never what the map has already."""

from __future__ import annotations

import numpy as np
import pytest

from koopcli.logs.hints import Said, factor_hint
from koopcli.logs.plausible import checks_of
from tests.logs.test_plausible import alarms, check, episodes_of, smooth


def turning(v, seed=2, understeer=0.002):
    r = 0.2 * smooth(len(v), seed)
    return r, 2.7 * r / v + understeer * r * v


def test_at_one_speed_the_wheelbase_is_taken_without_understeer():
    """Errors of the steer decide L and K where v hardly varies; together they are known."""
    v = 11 + 0.02 * smooth(600, 1)
    r, steer = turning(v)
    steer = steer + 0.01 * smooth(600, 9)
    side = 1.3 * r - 0.012 * r * v**2 + 0.01 * smooth(600, 8)
    checks = checks_of(episodes_of({"v_x": v, "v_y": side, "yaw_rate": r}, {"steer": steer}), 2.7)
    assert check(checks, "wheelbase").value == pytest.approx(2.7 + 0.002 * 11**2, rel=0.05)
    assert [c for c in checks if c.name == "side_speed"] == []
    assert alarms(checks) == []


def test_the_understeer_of_one_fast_speed_is_no_alarm_and_a_wrong_unit_is():
    v = 35 + 0.02 * smooth(600, 1)
    r, steer = turning(v, understeer=0.005)
    for factor, verdict in ((1, "note"), (57.3, "ask")):
        checks = checks_of(episodes_of({"v_x": v, "yaw_rate": r}, {"steer": factor * steer}), 2.7)
        assert check(checks, "wheelbase").verdict == verdict


def test_a_road_with_hardly_a_curve_tells_little_of_the_wheelbase():
    """Half a metre per second squared at most: what else moves the steering pulls the wheelbase down."""
    v, r = 25 + 4 * smooth(600, 1), 0.005 * smooth(600, 2)
    for factor, verdict in ((0.35, "note"), (16, "ask")):
        checks = checks_of(episodes_of({"v_x": v, "yaw_rate": r}, {"steer": factor * 2.7 * r / v}), 2.7)
        assert check(checks, "wheelbase").verdict == verdict


def test_no_sign_is_doubted_where_steer_and_yaw_rate_agree():
    """A wheelbase that the fit makes negative is one that it cannot tell."""
    v = 20 + 3 * smooth(600, 1)
    r = 0.2 * smooth(600, 2)
    checks = checks_of(episodes_of({"v_x": v, "yaw_rate": r}, {"steer": -1.5 * r / v + 0.02 * r * v}), 2.7)
    assert check(checks, "steer_yaw_correlation").verdict == "ok"
    assert check(checks, "wheelbase").value > 0
    assert not any("sign" in c.hint for c in checks)


@pytest.mark.parametrize(
    ("factors", "verdict", "words"),
    [
        ((1, 1, 1), "ok", ""),
        ((3.6, 1, 1), "ask", "'km/h'"),
        ((1, 57.3, 1), "ask", "'deg/s'"),
        ((1, 1, 1 / 9.80665), "ask", "unit = 'g'"),
        ((1, 1, -1), "ask", "sign = -1 for a_y"),
        ((3.6, 1, -1), "ask", "'km/h'"),
        ((1, 1, 25), "ask", "do not fit"),
    ],
)
@pytest.mark.parametrize("role", ["state", "input"])
def test_speed_times_yaw_rate_is_the_lateral_acceleration(factors, verdict, words, role):
    v, r = 15 + 3 * smooth(600, 1), 0.2 * smooth(600, 2)
    a_y = v * r + 0.1 * smooth(600, 3)
    states, inputs = {"v_x": factors[0] * v, "yaw_rate": factors[1] * r}, {}
    (states if role == "state" else inputs)["a_y"] = factors[2] * a_y
    result = check(checks_of(episodes_of(states, inputs)), "speed_yaw_acceleration")
    assert result.verdict == verdict
    assert result.value == pytest.approx(factors[0] * factors[1] / factors[2], rel=0.02)
    assert words in result.hint


def test_an_acceleration_that_goes_its_own_way_says_nothing():
    v, r = 15 + 3 * smooth(600, 1), 0.2 * smooth(600, 2)
    checks = checks_of(episodes_of({"v_x": v, "yaw_rate": r}, {"a_y": smooth(600, 7)}))
    assert not [c for c in checks if c.name == "speed_yaw_acceleration"]


def test_no_hint_proposes_what_the_map_has():
    degrees = Said({"steer": "deg", "v_x": "m/s", "yaw_rate": "rad/s"})
    assert "unit = 'deg'" in factor_hint(57.3)
    assert "unit = 'deg'" not in factor_hint(57.3, degrees)
    assert "yaw_rate" not in factor_hint(57.3, degrees)  # it is not in deg/s: it cannot be so by mistake
    assert "'km/h'" in factor_hint(3.6 * 15, degrees)
    assert "ratio = 15" in factor_hint(3.6 * 15, degrees)
    assert "ratio = 42" not in factor_hint(42.8, degrees)  # no steering has it
    turns = Said({"steer": "deg", "yaw_rate": "deg/s"})
    assert "yaw_rate" in factor_hint(50.0, turns, 0.1)
    assert "yaw_rate" not in factor_hint(50.0, turns, 2.0)  # of 115 m/s² then
    assert "'km/h'" not in factor_hint(3.6, Said({"v_x": "km/h"}))
    assert "ratio = 16" in factor_hint(1.6, Said(ratio=10.0))
    v = np.linspace(0, 200, 100)
    episodes = episodes_of({"v_x": v, "yaw_rate": np.ones(100)}, {})
    names = ("lateral_acceleration", "longitudinal_acceleration", "magnitude")
    for said, proposed in ((None, True), (Said({"v_x": "km/h", "yaw_rate": "deg/s"}), False)):
        checks = alarms(checks_of(episodes, None, said))
        assert {c.name for c in checks} == set(names)
        assert any("unit = " in c.hint for c in checks) is proposed
        assert all(c.hint for c in checks)


def test_no_lag_is_told_of_what_does_not_go_together():
    v, r, steer = 15 + 2 * smooth(600, 1, 60), 0.2 * smooth(600, 2), 0.03 * smooth(600, 31)
    checks = checks_of(episodes_of({"v_x": v, "yaw_rate": r}, {"steer": steer}))
    assert abs(check(checks, "steer_yaw_correlation").value) < 0.4
    assert not [c for c in checks if c.name == "steer_yaw_lag"]


def test_a_spike_is_named_with_its_time_and_file_and_misleads_no_other_check():
    v = 15 + 2 * smooth(600, 1, 60)
    r, steer = turning(v)
    clean = checks_of(episodes_of({"v_x": v, "yaw_rate": r}, {"steer": steer}, [0, 300, 600]), 2.7)
    assert check(clean, "spike").verdict == "ok"
    v[400] = 1e9
    places = [{"v_x": "a.csv, column 'vx'"}]
    checks = checks_of(episodes_of({"v_x": v, "yaw_rate": r}, {"steer": steer}, [0, 300, 600]), 2.7, None, places)
    (alarm,) = alarms(checks)
    assert (alarm.name, alarm.signal, alarm.verdict) == ("spike", "v_x", "warn")
    assert alarm.value > 1e7
    assert "at 1005 s of a.csv, column 'vx'" in alarm.hint


def test_what_lasts_is_no_spike():
    brake = np.where(np.arange(600) % 300 < 30, 1000.0, 0.0) + smooth(600, 1)
    assert alarms(checks_of(episodes_of({"v_x": 20 + 0.3 * smooth(600, 2)}, {"brake": brake}))) == []


@pytest.mark.parametrize(("noise", "verdict"), [(0.005, "warn"), (1.0, "ok")])
def test_an_input_that_is_a_state_once_more_is_named(noise, verdict):
    v = 15 + 3 * smooth(600, 1, 40)
    wheel = 3.6 * v + noise * smooth(600, 5)
    result = check(checks_of(episodes_of({"v_x": v}, {"wheel": wheel})), "copy")
    assert (result.verdict, result.signal) == (verdict, "wheel")
    assert ("v_x" in result.hint) is (verdict == "warn")


def test_no_value_that_is_ok_lies_outside_the_words_beside_it():
    for name, words in (("steer_yaw_correlation", "at least 0.5"), ("steer_yaw_lag", "at least 0")):
        v = 15 + 3 * smooth(600, 1)
        r, steer = turning(v)
        assert words in check(checks_of(episodes_of({"v_x": v, "yaw_rate": r}, {"steer": steer})), name).healthy
