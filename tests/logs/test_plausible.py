"""The checks of a log: what they find is exact where mathematics says so, and each defect is seen on a log of a car."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from koopcli.logs.check import Check
from koopcli.logs.hints import factor_hint
from koopcli.logs.plausible import checks_of
from koopcli.records import Channels, Episodes

SIMULATED = Path(__file__).parents[2] / "data/logs/simulated"
UNITS = {"v_x": "m/s", "v_y": "m/s", "yaw_rate": "rad/s", "steer": "rad"}
WHEELBASE = 2.6


def episodes_of(states, inputs, bounds=None, dt=0.05):
    x = np.column_stack(list(states.values()))
    u = np.column_stack(list(inputs.values())) if inputs else np.empty((len(x), 0))
    bounds = np.array([0, len(x)] if bounds is None else bounds)
    channels = [Channels(tuple(names), tuple(UNITS.get(name, "1") for name in names)) for names in (states, inputs)]
    count = len(bounds) - 1
    return Episodes(x, u, dt, bounds, np.arange(count) * 1000.0, np.zeros(count, dtype=np.int64), *channels)


def check(checks: list[Check], name: str, signal: str = "") -> Check:
    return next(each for each in checks if each.name == name and signal in ("", each.signal))


def alarms(checks: list[Check]) -> list[Check]:
    return [each for each in checks if each.verdict in ("warn", "ask")]


def smooth(rows: int, seed: int, width: int = 12) -> np.ndarray:
    noise = np.random.default_rng(seed).standard_normal(rows + width - 1)
    return np.convolve(noise, np.hanning(width), "valid") / np.sqrt((np.hanning(width) ** 2).sum())


def test_the_wheelbase_of_an_exact_car_is_recovered():
    v, r = 15 + 3 * smooth(400, 1), 0.2 * smooth(400, 2)
    steer = 0.01 + 2.71 * r / v + 0.002 * r * v
    result = check(checks_of(episodes_of({"v_x": v, "yaw_rate": r}, {"steer": steer}), 2.71), "wheelbase")
    assert result.value == pytest.approx(2.71, rel=1e-9)
    assert (result.verdict, result.unit, result.hint) == ("ok", "m", "")


def test_rows_below_a_quarter_of_the_top_speed_tell_nothing_of_the_wheelbase():
    v, r = 15 + smooth(400, 1), 0.2 * smooth(400, 2)
    steer = 2.71 * r / v
    v[:50], steer[:50] = 1.0, 3.0
    result = check(checks_of(episodes_of({"v_x": v, "yaw_rate": r}, {"steer": steer}), 2.71), "wheelbase")
    assert result.value == pytest.approx(2.71, rel=1e-9)


@pytest.mark.parametrize(
    ("ratio", "verdict"),
    [
        (1.0, "ok"),
        (1.49, "ok"),
        (1.51, "note"),
        (0.66, "note"),
        (2.49, "note"),
        (2.51, "ask"),
        (0.39, "ask"),
        (-1, "ask"),
    ],
)
def test_a_wheelbase_is_judged_beside_that_of_the_map(ratio, verdict):
    v, r = 15 + 3 * smooth(400, 1), 0.2 * smooth(400, 2)
    result = check(checks_of(episodes_of({"v_x": v, "yaw_rate": r}, {"steer": ratio * 2.5 * r / v}), 2.5), "wheelbase")
    assert (result.verdict, bool(result.hint)) == (verdict, verdict != "ok")


@pytest.mark.parametrize(("length", "verdict"), [(0.09, "ask"), (0.3, "ok"), (45.0, "ok"), (71.0, "ask")])
def test_without_a_wheelbase_any_car_and_any_steering_wheel_will_do(length, verdict):
    v, r = 15 + 3 * smooth(400, 1), 0.2 * smooth(400, 2)
    result = check(checks_of(episodes_of({"v_x": v, "yaw_rate": r}, {"steer": length * r / v})), "wheelbase")
    assert result.verdict == verdict


def test_the_lever_of_the_side_speed_is_recovered():
    v, r = 15 + 3 * smooth(400, 1), 0.2 * smooth(400, 2)
    result = check(
        checks_of(episodes_of({"v_x": v, "v_y": 1.3 * r - 0.004 * r * v**2, "yaw_rate": r}, {})), "side_speed"
    )
    assert result.value == pytest.approx(1.3, rel=1e-9)
    noise = smooth(400, 3)
    assert not [
        c for c in checks_of(episodes_of({"v_x": v, "v_y": noise, "yaw_rate": r}, {})) if c.name == "side_speed"
    ]


@pytest.mark.parametrize("rows", [0, 3, 8, -5])
@pytest.mark.parametrize("sign", [1, -1])
def test_the_lag_is_recovered_whatever_the_sign(rows, sign):
    turning = smooth(440, 5)
    v, r = np.full(400, 10.0), sign * turning[20 - rows : 420 - rows]
    checks = checks_of(episodes_of({"v_x": v, "yaw_rate": r}, {"steer": turning[20:420] / 10}))
    result = check(checks, "steer_yaw_lag")
    assert result.value == pytest.approx(rows * 0.05)
    assert (result.verdict, "offset" in result.hint) == (("warn", True) if rows < 0 else ("ok", False))


def test_no_lag_is_taken_across_a_seam():
    """Each episode lags by three rows; what joins them would say that it leads."""
    parts = [smooth(60, seed) for seed in range(12)]
    steer, r = np.concatenate([p[3:] for p in parts]), np.concatenate([p[:-3] for p in parts])
    bounds = 57 * np.arange(13)
    result = check(
        checks_of(episodes_of({"v_x": np.full(684, 10.0), "yaw_rate": r}, {"steer": steer}, bounds)), "steer_yaw_lag"
    )
    assert result.value == pytest.approx(0.15)


def test_nothing_crosses_a_seam():
    """Speed, its noise and its drive are of the episodes alone, which begin 30 m/s apart."""
    force = np.concatenate([smooth(200, 1), smooth(200, 2)])
    speed = np.concatenate(
        [10 + 0.05 * np.cumsum(np.r_[0, force[:199]]), 40 + 0.05 * np.cumsum(np.r_[0, force[200:399]])]
    )
    checks = checks_of(episodes_of({"v_x": speed}, {"force": force}, [0, 200, 400]))
    assert check(checks, "longitudinal_acceleration").value <= np.abs(force).max() + 1e-9
    assert check(checks, "drive").value == pytest.approx(1, abs=0.1)
    parts = [
        check(checks_of(episodes_of({"v_x": s}, {"force": f})), "noise")
        for s, f in ((speed[:200], force[:200]), (speed[200:], force[200:]))
    ]
    noise = check(checks, "noise").value
    assert min(p.value for p in parts) <= noise <= max(p.value for p in parts)


def test_a_speed_that_its_inputs_explain_is_driven_and_another_is_not():
    force, other = smooth(600, 1), smooth(600, 2)
    speed = 20 + 0.05 * np.cumsum(np.r_[0, force[:-1]])
    driven = check(checks_of(episodes_of({"v_x": speed}, {"force": force})), "drive")
    idle = check(checks_of(episodes_of({"v_x": speed}, {"other": other})), "drive")
    assert (driven.verdict, idle.verdict) == ("ok", "note")
    assert driven.value > 0.8
    assert idle.value < 0.1
    assert "pedal" in idle.hint


def test_white_noise_is_measured_by_its_second_difference():
    """White noise changes by √2 of its deviation, so its noise is 1/√2 of its change."""
    noise = np.random.default_rng(1).standard_normal(20_000)
    result = check(checks_of(episodes_of({"v_x": noise}, {})), "noise")
    assert result.value == pytest.approx(100 / np.sqrt(2), rel=0.02)
    assert (result.verdict, result.unit, result.signal) == ("note", "%", "v_x")
    assert check(checks_of(episodes_of({"v_x": smooth(2000, 1, 40)}, {})), "noise").verdict == "ok"


def test_rows_that_stay_are_counted_within_episodes():
    values = np.repeat(np.arange(50.0), 2)
    result = check(checks_of(episodes_of({"a": values}, {}, [0, 50, 100])), "unchanged", "a")
    assert result.value == pytest.approx(100 * 50 / 98)
    assert (result.verdict, result.signal) == ("note", "a")


@pytest.mark.parametrize(("lateral", "verdict"), [(16.9, "ok"), (17.1, "warn"), (59.0, "warn"), (61.0, "ask")])
def test_lateral_accelerations(lateral, verdict):
    result = check(
        checks_of(episodes_of({"v_x": np.full(50, 10.0), "yaw_rate": np.full(50, lateral / 10)}, {})),
        "lateral_acceleration",
    )
    assert (result.value, result.verdict) == (pytest.approx(lateral), verdict)


@pytest.mark.parametrize(
    ("slope", "wheelbase", "verdict"),
    [(14.0, 2.6, "ok"), (16.0, 2.6, "warn"), (16.0, None, "warn"), (39.0, 0.3, "ok"), (41.0, 0.3, "warn")],
)
def test_longitudinal_accelerations(slope, wheelbase, verdict):
    result = check(
        checks_of(episodes_of({"v_x": slope * 0.05 * np.arange(50)}, {}), wheelbase), "longitudinal_acceleration"
    )
    assert (result.value, result.verdict) == (pytest.approx(slope), verdict)


@pytest.mark.parametrize(
    ("ratio", "names"),
    [
        (1 / 57.3, "'deg/s'"),
        (3.6, "'km/h'"),
        (57.3, "'deg'"),
        (16.0, "ratio = 16"),
        (16 * 57.3, "ratio = 16"),
        (-1.0, "sign = -1"),
        (1e6, "units"),
    ],
)
def test_the_factor_that_mends_a_wheelbase_is_named(ratio, names):
    assert names in factor_hint(ratio)
    assert "\n" not in factor_hint(ratio)


def test_a_vertical_acceleration_of_one_is_in_g():
    def of(value):
        return check(checks_of(episodes_of({"a_z": value + 0.01 * smooth(100, 1)}, {})), "magnitude")

    assert (of(0.99).verdict, of(9.81).verdict) == ("ask", "ok")
    assert "unit = 'g'" in of(0.99).hint


def test_what_is_missing_constant_or_short_is_not_checked():
    still = np.full(100, 3.0)
    names = {c.name for c in checks_of(episodes_of({"v_x": still, "v_y": still, "yaw_rate": still}, {"steer": still}))}
    assert names == {"lateral_acceleration", "longitudinal_acceleration", "unchanged", "magnitude"}
    assert checks_of(episodes_of({"v_x": still[:5], "yaw_rate": still[:5]}, {"steer": still[:5]})) == []
    assert {c.name for c in checks_of(episodes_of({"a": smooth(100, 1)}, {}))} == {"spike", "unchanged", "noise"}


@pytest.fixture(scope="module")
def car() -> Episodes:
    """The simulated log that is kept, mended by hand."""
    motion = np.loadtxt(SIMULATED / "motion.csv", delimiter=",", skiprows=2)
    lines = (SIMULATED / "controls.csv").read_text(encoding="utf-8").replace('"', "").splitlines()
    controls = np.loadtxt(lines, delimiter=",", skiprows=1)
    motion = motion.reshape(4, -1, 4)[:, :-1:4].reshape(-1, 4)
    steer, torque = controls[:, 1:].reshape(-1, 2, 2).mean(axis=1).T
    v, r = motion[:, 1] / 3.6, -np.radians(motion[:, 3])
    side = 1.3 * r - 0.012 * r * v**2
    states = {"v_x": v, "v_y": side, "yaw_rate": r}
    return episodes_of(states, {"steer": np.radians(steer) / 16, "torque": torque}, 650 * np.arange(5), 0.04)


def changed(episodes: Episodes, name: str, factor: float, late: int = 0) -> Episodes:
    signals = [
        dict(zip(c.names, v.T, strict=True))
        for c, v in ((episodes.state_channels, episodes.x), (episodes.input_channels, episodes.u))
    ]
    for values in signals:
        if name in values:
            parts = (factor * values[name]).reshape(4, -1)
            values[name] = np.hstack([parts[:, :1].repeat(late, axis=1), parts[:, : parts.shape[1] - late]]).ravel()
    return episodes_of(*signals, episodes.bounds, episodes.dt)


@pytest.mark.parametrize("wheelbase", [WHEELBASE, None])
def test_a_clean_log_has_no_alarm(car, wheelbase):
    assert alarms(checks_of(car, wheelbase)) == []


DEFECTS = [
    ("yaw_rate", 57.3, 0, "lateral_acceleration", "57.3"),
    ("yaw_rate", -1, 0, "steer_yaw_correlation", "sign = -1 for yaw_rate"),
    ("v_x", 3.6, 0, "wheelbase", "km/h"),
    ("steer", 57.3, 0, "wheelbase", "deg"),
    ("steer", 16, 0, "wheelbase", "ratio = 16"),
    ("steer", -1, 0, "steer_yaw_correlation", "sign = -1 for steer"),
    ("steer", 1, 8, "steer_yaw_lag", "offset = -0.3"),
    ("v_y", -1, 0, "side_speed", "sign = -1 for v_y"),
]


@pytest.mark.parametrize(("signal", "factor", "late", "name", "hint"), DEFECTS)
def test_each_defect_is_seen_and_its_hint_names_what_mends_it(car, signal, factor, late, name, hint):
    result = check(alarms(checks_of(changed(car, signal, factor, late), WHEELBASE)), name)
    assert hint in result.hint
