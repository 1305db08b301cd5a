"""Logs as people bring them: slow sources, wrong units of time, several runs; what is said of each."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest

from koopcli.errors import InvalidValueError
from koopcli.logs.dates import DateError, seconds_of
from koopcli.logs.map import parse_map
from koopcli.logs.suggest import suggest
from tests.logs.test_log import MAP, TIME, drive, imported, write
from tests.logs.test_suggest import T, wave
from tests.logs.test_suggest import write as written


def test_several_runs_of_a_given_step_may_have_a_side_speed(tmp_path: Path) -> None:
    columns = drive()
    for run in (1, 2):
        write(tmp_path / f"run_{run}.csv", {**columns, "w": run * 0.1 * np.cos(TIME)})
    text = MAP.replace("[inputs]", 'v_y = { column = "w", unit = "m/s" }\n[inputs]')
    log = imported(tmp_path, text)
    assert log.episodes.state_channels.names == ("v_x", "yaw_rate", "v_y")
    assert len(log.episodes) == 2


def slow_log(folder: Path, step: float) -> Path:
    columns = drive()
    write(folder / "fast.csv", {key: columns[key] for key in "trd"})
    slow = np.arange(0, 10 + step, step)
    write(folder / "slow.csv", {"t": slow, "v": 36 + slow + np.sin(slow)})
    return folder


SLOW = """
log = { dt = 0.05 }
[source.fast]
file = "fast.csv"
[source.slow]
file = "slow.csv"
[states]
yaw_rate = { source = "fast", column = "r", unit = "deg/s" }
v_x = { source = "slow", column = "v", unit = "km/h" }
[inputs]
steer = { source = "fast", column = "d", unit = "deg" }
"""


@pytest.mark.parametrize(("step", "verdict"), [(0.05, "ok"), (0.1, "ok"), (0.2, "ask"), (1.0, "ask")])
def test_a_state_that_is_slower_than_the_grid_asks(tmp_path: Path, step: float, verdict: str) -> None:
    checks = imported(slow_log(tmp_path, step), SLOW).checks
    (slow,) = (each for each in checks if each.name == "slow_source")
    assert (slow.signal, slow.verdict) == ("v_x", verdict)
    assert slow.value == pytest.approx(step / 0.05)
    assert (f"dt = {step:g}" in slow.hint) is (verdict == "ask")


def test_a_slow_input_is_held_and_no_matter(tmp_path: Path) -> None:
    slow_log(tmp_path, 1.0)
    text = SLOW.replace("[states]", "[states]\nw = { source = 'fast', column = 'd' }")
    text = text.replace('v_x = { source = "slow", column = "v", unit = "km/h" }\n', "")
    text = text.replace(
        'steer = { source = "fast", column = "d", unit = "deg" }', 'throttle = { source = "slow", column = "v" }'
    )
    checks = imported(tmp_path, text).checks
    assert [each.verdict for each in checks if each.name == "slow_source"] == ["ok"]


def test_a_state_that_would_be_invented_is_refused_with_the_unit_of_its_time(tmp_path: Path) -> None:
    columns = drive()
    path = write(tmp_path / "log.csv", {**columns, "t": 1000 * columns["t"]})
    with pytest.raises(InvalidValueError, match=r"every 10 s and log.dt is 0.05 s.* time in ms .*dt = 10"):
        imported(path)
    with pytest.raises(InvalidValueError, match=r"log\.dt is 0\.0004 s"):
        imported(write(tmp_path / "log.csv", columns), MAP.replace("0.05", "0.0004"))


def test_a_run_that_is_there_twice_counts_once(tmp_path: Path) -> None:
    for name in ("a", "b"):
        write(tmp_path / f"{name}.csv", drive())
    log = imported(tmp_path)
    assert len(log.episodes) == 1
    assert "run b.csv holds the numbers of run a.csv: left out" in log.notes


def test_an_ending_matches_whole_names_unless_it_begins_with_a_mark(tmp_path: Path) -> None:
    write(tmp_path / "copy_log.csv", drive())
    with pytest.raises(InvalidValueError, match=r"no file given ends with 'log\.csv'"):
        imported(tmp_path, MAP + '[source.car]\nfile = "log.csv"\n')
    for ending in ("_log.csv", ".csv", "copy_log.csv", "*_log.csv"):
        assert len(imported(tmp_path, MAP + f'[source.car]\nfile = "{ending}"\n').episodes) == 1


def test_errors_name_what_mends_them(tmp_path: Path) -> None:
    columns = {key: values[:300] for key, values in drive().items()}
    path = write(tmp_path / "log.csv", {**columns, "t": columns["t"] / 10})
    with pytest.raises(InvalidValueError, match=r"lasts 0\.299 s: is the unit of its time right"):
        imported(path)
    path = write(tmp_path / "log.csv", {**drive(), "d": np.ones(len(TIME))})
    with pytest.raises(InvalidValueError, match="map a column that changes, or take it out of the map"):
        imported(path)
    rows = [f"2024-05-29 13:53:{k // 50:02d}.{k % 50 * 20:03d},{9 + k % 7},{k % 5},{k % 3}" for k in range(200)]
    path.write_text("\n".join(["t,v,r,d", *rows]) + "\n")
    with pytest.raises(InvalidValueError, match="is not a number: say its format"):
        imported(path)


def test_dates_are_read_by_the_second() -> None:
    texts = ["2024-05-29 13:53:59.849999872", "2024-05-29 13:53:59.87", "2024-05-29 13:54:00.0"]
    seconds = seconds_of(texts, "%Y-%m-%d %H:%M:%S.%f")
    assert np.diff(seconds) == pytest.approx([0.020000128, 0.13], abs=1e-6)
    assert seconds_of(["1970_01_01_00_00_02_500"], "%Y_%m_%d_%H_%M_%S_%f").tolist() == [2.5]
    assert seconds_of(["1970-01-01 00:00:02"], "%Y-%m-%d %H:%M:%S").tolist() == [2.0]
    assert seconds_of(["1970-01-01 01:00:02+01:00"], "%Y-%m-%d %H:%M:%S%z").tolist() == [2.0]
    for texts in (["1970-01-01 00:00:02.1", "1970-01-01 00:00:02"], ["1970-01-01 00:00:02.1", "x.1"]):
        with pytest.raises(DateError) as error:
            seconds_of(texts, "%Y-%m-%d %H:%M:%S.%f")
        assert error.value.row == 1
    begin = time.process_time()
    texts = [f"2024-05-29 13:{k // 6000:02d}:{k // 100 % 60:02d}.{k % 100:02d}" for k in range(100_000)]
    seconds_of(texts, "%Y-%m-%d %H:%M:%S.%f")
    assert time.process_time() - begin < 1.0


def test_files_of_equal_columns_are_runs_by_a_pattern(tmp_path: Path) -> None:
    files = [written(tmp_path / f"{n}.csv", "t,vx,wz", T, 9 + wave(1, k), wave(0.3)) for k, n in enumerate("abc")]
    suggestion = suggest(files)
    (source,) = parse_map(suggestion.text).sources
    assert source.file == "*.csv"
    assert any("3 files have the columns of a.csv" in note for note in suggestion.notes)
    other = written(tmp_path / "other.csv", "t,steer", T, wave(0.3))
    files = [file.rename(file.with_name(f"run_{file.name}")) for file in files]
    assert [source.file for source in parse_map(suggest([*files, other]).text).sources] == ["run_*.csv", "other.csv"]
    topics = [written(tmp_path / f"{n}.csv", "t,x,y,z", T, wave(1), wave(2), wave(3)) for n in ("gyro", "acc")]
    assert not any("each is taken for a run" in note for note in suggest(topics).notes)


def test_runs_in_numbered_folders_share_the_names_of_their_files(tmp_path: Path) -> None:
    files = []
    for run in (1, 2):
        folder = tmp_path / f"run_{run}"
        files.append(written(folder / "data.csv", "vx,wz", 9 + wave(1, run), wave(0.3)))
        files.append(written(folder / "time.csv", "", T))
    (source,) = parse_map(suggest(files).text).sources
    assert (source.file, source.time.file) == ("data.csv", "time.csv")


def test_a_date_without_a_name_is_the_time_before_what_only_counts(tmp_path: Path) -> None:
    rows = [f"2024_04_23_12_21_{k // 50:02d}_{k % 50 * 20:03d},{9 + k % 7},{3 * k + k % 2}" for k in range(200)]
    (tmp_path / "log.csv").write_text("\n".join(rows) + "\n")
    assert 'column = 0, format = "%Y_%m_%d_%H_%M_%S_%f"' in suggest([tmp_path / "log.csv"]).text


@pytest.mark.parametrize(
    ("title", "name"),
    [("deltawheel_rad", "steer"), ("TwheelRL_Nm", "torque"), ("omega(rad/s)", "yaw_rate"), ("SW_pos_obd", "steer")],
)
def test_more_names_are_known(tmp_path: Path, title: str, name: str) -> None:
    suggestion = suggest([written(tmp_path / "log.csv", f"t,vx,{title}", T, 9 + wave(1), wave(0.3))])
    assert [signal.name for signal in parse_map(suggestion.text).signals] == ["v_x", name]


def test_the_rate_of_a_wheel_is_no_yaw_rate(tmp_path: Path) -> None:
    text = suggest([written(tmp_path / "log.csv", "t,vx,omega_wheel_fl", T, 9 + wave(1), wave(0.3))]).text
    assert [signal.name for signal in parse_map(text).signals] == ["v_x"]


def test_a_pressure_of_the_brake_is_in_bar(tmp_path: Path) -> None:
    suggestion = suggest([written(tmp_path / "log.csv", "t,vx,brake_pressure_obd", T, 9 + wave(1), 20 + wave(19))])
    assert parse_map(suggestion.text).inputs[0].unit == "bar"


@pytest.mark.parametrize("speed", ["m/s", "km/h"])
@pytest.mark.parametrize("rate", ["rad/s", "deg/s"])
@pytest.mark.parametrize("lateral", ["ayCG", "LatAcc_obd"])
def test_units_are_settled_by_the_lateral_acceleration(tmp_path: Path, speed: str, rate: str, lateral: str) -> None:
    """Speeds whose size tells nothing, a file for each signal, and an acceleration whose sign is another."""
    v, r = (70 if speed == "m/s" else 14) + wave(4, 1), wave(0.05, 2)
    time = 8 * T
    columns = {"vx": v * (3.6 if speed == "km/h" else 1), "wz": r * (57.3 if rate == "deg/s" else 1), lateral: -v * r}
    files = [written(tmp_path / f"{name}.csv", "", time, values) for name, values in columns.items()]
    files += [written(tmp_path / "throttle.csv", "", time, 50 + wave(40))]
    suggestion = suggest(files)
    units = {signal.name: signal.unit for signal in parse_map(suggestion.text).states}
    assert units == {"v_x": speed, "yaw_rate": rate}
    assert any("but for its sign" in note for note in suggestion.notes)


@pytest.mark.parametrize("speed", ["m/s", "km/h"])
def test_a_unit_is_settled_by_the_longitudinal_acceleration(tmp_path: Path, speed: str) -> None:
    factor = 3.6 if speed == "km/h" else 1
    v, a_x = 50 / factor + 4 * np.sin(3 * T), 12 * np.cos(3 * T)
    path = written(tmp_path / "log.csv", "t,vx,axCG", T, factor * v + (20 if speed == "m/s" else 0), a_x)
    assert {s.name: s.unit for s in parse_map(suggest([path]).text).states} == {"v_x": speed}
