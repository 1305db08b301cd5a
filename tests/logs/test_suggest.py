"""First maps: what names, units and magnitudes say is in the map, and what was guessed is said beside it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from koopcli.errors import InvalidValueError
from koopcli.logs.map import parse_map
from koopcli.logs.quantities import quantity_of, unit_in, words_of
from koopcli.logs.suggest import suggest

SIMULATED = Path(__file__).parents[2] / "data/logs/simulated"
T = np.arange(200) * 0.02


def write(path: Path, header: str, *columns: np.ndarray, delimiter: str = ",") -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = [delimiter.join(f"{value:.16g}" for value in row) for row in zip(*columns, strict=True)]
    path.write_text("\n".join([header, *rows] if header else rows) + "\n")
    return path


def wave(height: float, seed: int = 0) -> np.ndarray:
    return height * np.sin(3 * T + seed)


@pytest.mark.parametrize(
    ("title", "name"),
    [
        ("speed", "v_x"),
        ("vx", "v_x"),
        ("vehicleSpeed", "v_x"),
        ("Velocity X", "v_x"),
        ("v_mps", "v_x"),
        ("gyro z", "yaw_rate"),
        ("gyroZ", "yaw_rate"),
        ("wz", "yaw_rate"),
        ("YawRate", "yaw_rate"),
        ("yawrate_degps", "yaw_rate"),
        ("angular_velocity.z", "yaw_rate"),
        ("delta", "steer"),
        ("swa", "steer"),
        ("SteeringWheelAngle", "steer"),
        ("steering angle", "steer"),
        ("beta", "side_slip"),
        ("vy", "v_y"),
        ("throttle_pct", "throttle"),
        ("BrakePressure", "brake"),
        ("motor_torque_Nm", "torque"),
        ("wheel_speed_fl", None),
        ("engine speed", None),
        ("yaw_rate_target", None),
        ("steering_torque", None),
        ("angular_velocity.x", None),
        ("temperature", None),
        ("lap", None),
    ],
)
def test_names_are_known_by_their_words(title, name):
    meaning = quantity_of(title)
    assert (meaning[0].name if meaning else None) == name


def test_units_stand_at_the_end_of_names():
    assert words_of("gyroZ [deg/s]") == ("gyro", "z", "deg", "s")
    assert unit_in("speed_kmh") == ("speed", "km/h")
    assert unit_in("yaw_rate_degps") == ("yaw_rate", "deg/s")
    assert unit_in("speed") == ("speed", "")


def test_the_simulated_log_has_a_map_that_only_lacks_what_no_header_says():
    suggestion = suggest(sorted(SIMULATED.glob("*.csv")))
    log_map, mended = parse_map(suggestion.text), parse_map((SIMULATED / "map.toml").read_text())
    said = {signal.name: (signal.columns, signal.unit, signal.ratio) for signal in log_map.signals}
    assert said == {signal.name: (signal.columns, signal.unit, signal.ratio) for signal in mended.signals}
    assert log_map.dt == mended.dt
    assert sorted(source.file for source in log_map.sources) == ["controls.csv", "motion.csv"]
    assert any("v_lat" in note and "constant" in note for note in suggestion.notes)
    assert any("26 s" in note for note in suggestion.notes)
    assert any("ratio" in note for note in suggestion.notes)


def test_units_that_nothing_says_are_guessed_from_magnitudes_and_said_to_be(tmp_path):
    path = write(
        tmp_path / "log.csv", "t,speed,wz,steer,throttle", T, 100 + wave(20), wave(80), wave(0.3), 50 + wave(40)
    )
    suggestion = suggest([path])
    units = {signal.name: signal.unit for signal in parse_map(suggestion.text).signals}
    assert units == {"v_x": "km/h", "yaw_rate": "deg/s", "steer": "rad", "throttle": "%"}
    guessed = [line.partition(" ")[0] for line in suggestion.text.splitlines() if "unit guessed" in line]
    assert guessed == ["v_x", "yaw_rate", "steer", "throttle"]


def test_units_in_names_and_brackets_are_taken(tmp_path):
    path = write(
        tmp_path / "log.csv", "time [ms],vx_mps,yaw_rate(deg/s),p_brake [bar]", 1e3 * T, 9 + wave(1), wave(1), wave(8)
    )
    log_map = parse_map(suggest([path]).text)
    assert [(signal.name, signal.unit) for signal in log_map.signals] == [
        ("v_x", "m/s"),
        ("yaw_rate", "deg/s"),
        ("brake", "bar"),
    ]
    assert (log_map.sources[0].time.column, log_map.sources[0].time.unit) == ("time", "ms")


def test_numbers_without_names_are_listed_with_their_ranges(tmp_path):
    suggestion = suggest([write(tmp_path / "log.txt", "", T, 9 + wave(1), delimiter=" ")])
    assert "#   column 0 from 0 to 3.98" in suggestion.text
    assert "time = { column = 0" in suggestion.text
    with pytest.raises(InvalidValueError, match="no states"):
        parse_map(suggestion.text)


def test_a_time_without_a_name_is_what_only_rises(tmp_path):
    path = write(tmp_path / "log.csv", ",stuff,vx", np.arange(200.0), 1.7e12 + 1e3 * T, 9 + wave(1))
    suggestion = suggest([path])
    time = parse_map(suggestion.text).sources[0].time
    assert (time.column, time.unit) == ("stuff", "ms")
    assert any("only rises" in note for note in suggestion.notes)


def test_seconds_and_nanoseconds_in_two_columns(tmp_path):
    path = write(tmp_path / "log.csv", "s,ns,vx", np.floor(T), 1e9 * (T % 1), 9 + wave(1))
    time = parse_map(suggest([path]).text).sources[0].time
    assert (time.s, time.ns) == ("s", "ns")


def test_times_that_are_dates(tmp_path):
    rows = [f"2024_02_10_00_07_{k // 50:02d}_{k % 50 * 20:03d},{9 + k % 7}" for k in range(200)]
    path = tmp_path / "log.csv"
    path.write_text("time,vx\n" + "\n".join(rows) + "\n")
    assert parse_map(suggest([path]).text).sources[0].time.format == "%Y_%m_%d_%H_%M_%S_%f"


def test_one_file_a_channel_with_its_time_beside(tmp_path):
    """Arrays without endings, as gyro/value and gyro/t: the third column of the gyro is the yaw rate."""
    for name, values in (("speed", 9 + wave(1)), ("gyro", np.column_stack([wave(0.1, k) for k in range(3)]))):
        (tmp_path / name).mkdir()
        for part, content in (("t", T), ("value", values)):
            with (tmp_path / name / part).open("wb") as stream:
                np.save(stream, content)
    log_map = parse_map(suggest(sorted(tmp_path.glob("*/*"))).text)
    places = {signal.name: (signal.source, signal.columns) for signal in log_map.signals}
    assert places == {"v_x": ("speed", (0,)), "yaw_rate": ("gyro", (2,))}
    assert {source.file: source.time.file for source in log_map.sources} == {
        "speed/value": "speed/t",
        "gyro/value": "gyro/t",
    }


def test_a_file_without_a_time_asks_for_its_rate(tmp_path):
    suggestion = suggest([write(tmp_path / "log.csv", "vx,wz", 9 + wave(1), wave(1))])
    assert parse_map(suggestion.text).sources[0].time.rate == 100
    assert any("no time" in note for note in suggestion.notes)


def test_arrays_of_other_formats_are_listed(tmp_path):
    np.savez(tmp_path / "log.npz", time=T, vx=9 + wave(1), yaw_rate=wave(0.3), steer=wave(0.1), lap=np.ones(200))
    suggestion = suggest([tmp_path / "log.npz"])
    assert [signal.name for signal in parse_map(suggestion.text).signals] == ["v_x", "yaw_rate", "steer"]
    assert "time, vx, yaw_rate, steer, lap" in suggestion.text


def test_files_of_one_name_are_runs_and_what_is_commanded_is_no_state(tmp_path):
    files = []
    for run in ("a", "b"):
        files.append(write(tmp_path / run / "odom.csv", "t,vx,wz", T, 3 + wave(1), np.zeros(200)))
        files.append(write(tmp_path / run / "imu.csv", "t,wz", T, wave(90)))
        files.append(write(tmp_path / run / "commandData.csv", "t,V,delta", T, 3 + wave(1, 1), wave(0.3)))
    suggestion = suggest(files)
    log_map = parse_map(suggestion.text)
    assert {signal.name: signal.source for signal in log_map.signals} == {
        "v_x": "odom", "yaw_rate": "imu", "steer": "command_data", "v_command": "command_data"
    }  # fmt: skip
    assert len(log_map.sources) == 3
    assert any("odom.csv is there 2 times" in note for note in suggestion.notes)


def test_torques_of_four_wheels_are_added(tmp_path):
    names = ",".join(f"torque_{corner}" for corner in ("fl", "fr", "rl", "rr"))
    path = write(tmp_path / "log.csv", f"t,vx,{names}", T, 9 + wave(1), *(wave(50, k) for k in range(4)))
    torque = parse_map(suggest([path]).text).inputs[0]
    assert (len(torque.columns), torque.reduce) == (4, "sum")


def test_clocks_that_do_not_meet_are_noted(tmp_path):
    files = [write(tmp_path / "a.csv", "t,vx", T, 9 + wave(1)), write(tmp_path / "b.csv", "t,wz", T + 900, wave(1))]
    assert any("do not overlap" in note for note in suggest(files).notes)


def test_rows_of_a_standing_car_are_left_out(tmp_path):
    path = write(tmp_path / "log.csv", "t,vx", T, np.where(T < 1, 0.0, 15 + wave(1)))
    suggestion = suggest([path])
    (condition,) = parse_map(suggestion.text).keep
    assert (condition.signal, condition.comparison, condition.value) == ("v_x", ">", 1.0)
    assert any("stands for 25 % of the rows: only rows with v_x > 1 m/s are kept" in note for note in suggestion.notes)


def test_what_is_not_found_is_said(tmp_path):
    suggestion = suggest([write(tmp_path / "log.csv", "t,vx", T, 9 + wave(1))])
    parse_map(suggestion.text)
    assert {"yaw_rate was not found", "steer was not found"} <= {note.partition(":")[0] for note in suggestion.notes}


def test_names_from_a_file_stay_inside_quotes_and_comments(tmp_path):
    """A column's name with quotes, brackets and steering letters makes a map that means that column."""
    name = 'speed "x" \\ ]\x1b[0m # '
    np.savez(tmp_path / "log.npz", **{"time": T, name: 9 + wave(1), "vx\n[states]\nhack = 1": wave(1)})
    suggestion = suggest([tmp_path / "log.npz"])
    log_map = parse_map(suggestion.text)
    assert [signal.name for signal in log_map.signals] == ["v_x"]
    assert "\x1b" not in suggestion.text + "".join(suggestion.notes)


def test_files_that_hold_nothing_are_refused(tmp_path):
    (tmp_path / "empty.csv").write_text("")
    with pytest.raises(InvalidValueError, match=r"empty\.csv"):
        suggest([tmp_path / "empty.csv"])
    with pytest.raises(InvalidValueError, match="0 files"):
        suggest([])
