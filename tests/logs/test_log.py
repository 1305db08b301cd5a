"""Files and a map in, a log out: what is recovered, where episodes end, and what is refused."""

from pathlib import Path

import numpy as np
import pytest

from koopcli.errors import InvalidValueError
from koopcli.logs.log import Log, expand, import_log
from koopcli.logs.map import parse_map

DT = 0.05
MAP = """
log = { dt = 0.05 }
[states]
v_x = { column = "v", unit = "km/h" }
yaw_rate = { column = "r", unit = "deg/s" }
[inputs]
steer = { column = "d", unit = "deg" }
"""
TIME = np.arange(0, 10, 0.01)


def speed(time: np.ndarray) -> np.ndarray:
    return np.asarray(10 + 0.5 * time)


def drive(time: np.ndarray = TIME) -> dict[str, np.ndarray]:
    """Speed in km/h that grows by 0.5 m/s², yaw rate in deg/s, steer in deg."""
    return {"t": time, "v": 3.6 * speed(time), "r": 20 * np.sin(time), "d": np.sign(np.sin(2 * time)) * 3}


def write(path: Path, columns: dict[str, np.ndarray]) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = zip(*columns.values(), strict=True)
    path.write_text("\n".join([",".join(columns), *(",".join(repr(float(v)) for v in row) for row in rows)]) + "\n")
    return path


def imported(path: Path, text: str = MAP) -> Log:
    return import_log(expand([str(path)]), parse_map(text))


def check(log: Log, name: str) -> tuple[float, str]:
    (only,) = [each for each in log.checks if each.name == name]
    return only.value, only.verdict


def test_a_line_is_recovered_in_si_and_steer_is_the_mean_over_the_step(tmp_path: Path) -> None:
    columns = drive()
    log = imported(write(tmp_path / "log.csv", columns))
    episodes = log.episodes
    assert (len(episodes), episodes.rows, episodes.dt) == (1, 200, DT)
    assert episodes.x[:, 0] == pytest.approx(speed(episodes.time), abs=1e-12)
    assert episodes.x[:, 1] == pytest.approx(np.radians(20 * np.sin(episodes.time)), abs=1e-4)
    means = np.radians(columns["d"]).reshape(200, 5).mean(axis=1)
    assert episodes.u[:, 0] == pytest.approx(means, abs=1e-12)
    assert str(episodes.state_channels) == "v_x (m/s), yaw_rate (rad/s)"
    assert log.display == {"v_x": "km/h", "yaw_rate": "deg/s", "steer": "deg"}
    assert [check(log, name) for name in ("repeated_time", "gaps", "first_row")] == [(0, "ok")] * 3
    assert check(log, "time_jitter")[0] == pytest.approx(0, abs=1e-9)


def test_a_log_is_the_same_after_it_was_stored(tmp_path: Path) -> None:
    log = imported(write(tmp_path / "log.csv", drive()))
    assert Log.unpack(log.pack()) == log
    figures = log.figures()
    assert (figures["rows"], figures["episodes"], figures["states"]) == (200, 1, ["v_x", "yaw_rate"])
    assert figures["seconds_logged"] == pytest.approx(199 * DT)
    assert {"name", "value", "verdict"} <= figures["checks"][0].keys()


def test_sign_ratio_reduce_offset_and_the_unit_of_the_file_count(tmp_path: Path) -> None:
    columns = drive()
    left, right = columns["v"] - 1, columns["v"] + 1
    path = write(tmp_path / "log.csv", {"t": TIME, "l (km/h)": left, "r (km/h)": right, "d": columns["d"]})
    text = """
    log = { dt = 0.05 }
    [source.car]
    offset = 5.0
    [states]
    v_x = { columns = ["l", "r"] }
    wheel = { column = "l", unit = "km/h", sign = -1, ratio = 2 }
    [inputs]
    steer = { column = "d", unit = "deg" }
    """
    log = imported(path, text)
    assert log.episodes.starts[0] == pytest.approx(5.0)
    assert log.episodes.x[:, 0] == pytest.approx(speed(log.episodes.time - 5), abs=1e-12)
    assert log.episodes.x[:, 1] == pytest.approx(-(log.episodes.x[:, 0] - 1 / 3.6) / 2, abs=1e-12)
    assert "v_x taken in km/h, as its file says" in log.notes


def test_a_side_slip_becomes_v_y_at_the_centre(tmp_path: Path) -> None:
    columns = drive() | {"b": 2 * np.cos(TIME)}
    text = MAP.replace("[inputs]", 'side_slip = { column = "b", unit = "deg", lever = 0.4 }\n[inputs]')
    log = imported(write(tmp_path / "log.csv", columns), text)
    time = log.episodes.time
    expected = speed(time) * np.tan(np.radians(2 * np.cos(time))) - 0.4 * np.radians(20 * np.sin(time))
    assert log.episodes.state_channels.names == ("v_x", "yaw_rate", "v_y")
    assert log.episodes.x[:, 2] == pytest.approx(expected, abs=1e-5)
    assert log.display["v_y"] == "m/s"


def test_an_exogenous_state_is_an_input(tmp_path: Path) -> None:
    log = imported(write(tmp_path / "log.csv", drive()), 'exogenous = ["v_x"]\n' + MAP)
    assert (log.episodes.state_channels.names, log.episodes.input_channels.names) == (("yaw_rate",), ("steer", "v_x"))
    assert log.episodes.u[:, 1] == pytest.approx(speed(log.episodes.time + 0.02), abs=1e-12)


def test_a_heading_that_wraps_becomes_a_yaw_rate(tmp_path: Path) -> None:
    columns = drive() | {"h": np.degrees(np.angle(np.exp(1j * (1.5 * TIME + 0.1 * TIME**2))))}
    text = MAP.replace('"r", unit = "deg/s"', '"h", unit = "deg", from = "heading", width = 0.1')
    episodes = imported(write(tmp_path / "log.csv", columns), text).episodes
    assert episodes.starts[0] == pytest.approx(0.1)
    assert episodes.x[:, 1] == pytest.approx(1.5 + 0.2 * (episodes.time - 0.05), abs=1e-9)


def test_a_smoothed_state_begins_at_its_first_whole_mean(tmp_path: Path) -> None:
    text = MAP.replace('unit = "km/h"', 'unit = "km/h", smooth = 5')
    episodes = imported(write(tmp_path / "log.csv", drive()), text).episodes
    assert episodes.starts[0] == pytest.approx(0.04)
    assert episodes.x[:, 0] == pytest.approx(speed(episodes.time - 0.02), abs=1e-12)


def test_clocks_that_start_apart_share_the_time_that_all_have(tmp_path: Path) -> None:
    late = np.arange(1.003, 8, 0.013)
    for name in ("v", "r", "d"):
        time = TIME if name == "v" else late if name == "r" else TIME + 0.005
        write(tmp_path / f"{name}.csv", {"s": np.floor(time), "ns": np.round(time % 1 * 1e9), name: drive(time)[name]})
    sources = "\n".join(f'[source.{n}]\nfile = "{n}.csv"\ntime = {{ s = "s", ns = "ns" }}' for n in "vrd")
    text = MAP
    for name in "vrd":
        text = text.replace(f'column = "{name}"', f'source = "{name}", column = "{name}"')
    episodes = imported(tmp_path, text + sources).episodes
    assert episodes.starts[0] == pytest.approx(1.003)
    assert late[-1] - DT < episodes.time[-1] <= late[-1]
    assert episodes.x[:, 0] == pytest.approx(speed(episodes.time), abs=1e-9)


def test_the_step_is_that_of_the_slowest_state_if_none_is_said(tmp_path: Path) -> None:
    assert (
        imported(write(tmp_path / "a.csv", drive(np.arange(0, 10, 0.0401))), MAP.split("\n", 2)[2]).episodes.dt == 0.04
    )


def test_a_silence_and_what_is_not_kept_and_nan_end_an_episode(tmp_path: Path) -> None:
    columns = drive(TIME[(TIME <= 3) | (TIME > 3.5)])
    text = MAP.replace("dt = 0.05", 'dt = 0.05, shortest = 1.0, keep = "v_x < 14.49 m/s and v_x > 10.25"')
    columns["r"][(columns["t"] > 6.005) & (columns["t"] < 6.495)] = np.nan
    log = imported(write(tmp_path / "log.csv", columns), text)
    episodes = log.episodes
    assert episodes.starts == pytest.approx([0.55, 3.55, 6.5])
    ends = episodes.time[episodes.bounds[1:] - 1]
    assert ends == pytest.approx([3.0, 6.0, 8.95])
    assert check(log, "gaps") == (2, "note")
    assert episodes.x[:, 0] == pytest.approx(speed(episodes.time), abs=1e-9)


def test_short_stretches_are_left_out_and_counted(tmp_path: Path) -> None:
    columns = drive(TIME[(TIME <= 2) | (TIME > 2.5)])
    log = imported(write(tmp_path / "log.csv", columns))
    assert len(log.episodes) == 1
    assert "1 stretch shorter than 2.5 s left out" in log.notes


def test_runs_are_never_joined(tmp_path: Path) -> None:
    for run in ("run_1", "run_2", "run_10"):
        write(tmp_path / run / "log.csv", drive(TIME + int(run[4:])))
    for text in (MAP, MAP.replace("dt = 0.05", 'dt = 0.05, runs = "run_*"')):
        episodes = imported(tmp_path, text).episodes
        assert (episodes.runs.tolist(), episodes.lengths.tolist()) == ([0, 1, 2], [200] * 3)
        assert episodes.starts == pytest.approx([1, 2, 10])


def test_files_in_folders_belong_together_and_those_not_used_are_named(tmp_path: Path) -> None:
    columns = drive()
    for run in ("a", "b"):
        columns["d"] = 1.1 * columns["d"]
        for name, pick in (("car", ("t", "v", "r")), ("steer", ("t", "d"))):
            write(tmp_path / run / f"{name}.csv", {key: columns[key] for key in pick})
    write(tmp_path / "b" / "other.csv", columns)
    text = MAP + '[source.car]\nfile = "car.csv"\n[source.steer]\nfile = "steer.csv"\n'
    text = text.replace('column = "d"', 'source = "steer", column = "d"')
    for name in "vr":
        text = text.replace(f'column = "{name}"', f'source = "car", column = "{name}"')
    log = imported(tmp_path, text)
    assert log.episodes.runs.tolist() == [0, 1]
    assert "1 file not in the map: b/other.csv" in log.notes
    (tmp_path / "b" / "steer.csv").unlink()
    with pytest.raises(InvalidValueError, match=r"2 of source.car, 1 of source.steer"):
        imported(tmp_path, text)


def test_time_is_found_in_a_file_beside_in_a_date_and_by_a_rate(tmp_path: Path) -> None:
    columns = drive()
    for name in ("v", "r", "d"):
        (tmp_path / name).mkdir()
        for file, values in (("value", columns[name]), ("t", TIME)):
            with (tmp_path / name / file).open("wb") as stream:
                np.save(stream, values)
    sources = "".join(f'[source.{n}]\nfile = "{n}/value"\ntime = {{ file = "t" }}\n' for n in "vrd")
    text = MAP + sources
    for name in "vrd":
        text = text.replace(f'column = "{name}"', f'source = "{name}", column = 0')
    beside = imported(tmp_path, text).episodes
    by_rate = text.replace('{ file = "t" }', "{ rate = 100 }")
    assert imported(tmp_path, by_rate).episodes.x == pytest.approx(beside.x, abs=1e-9)
    dates = [f"2024_02_10_00_07_{int(t):02d}_{round(t % 1 * 1000):03d}" for t in TIME]
    lines = [f"{a},{v!r},{r!r},{d!r}" for a, v, r, d in zip(dates, *(columns[n].tolist() for n in "vrd"), strict=True)]
    (tmp_path / "date.csv").write_text("\n".join(["when,v,r,d", *lines]))
    source = '[source.car]\nfile = "date.csv"\ntime = { column = "when", format = "%Y_%m_%d_%H_%M_%S_%f" }\n'
    assert imported(tmp_path, MAP + source).episodes.x == pytest.approx(beside.x, abs=1e-5)


def test_inputs_may_be_one_row_shorter(tmp_path: Path) -> None:
    columns = drive()
    np.savez(tmp_path / "log.npz", **(columns | {"d": columns["d"][:-1]}))
    log = imported(tmp_path / "log.npz")
    assert log.episodes.rows == 200
    np.savez(tmp_path / "log.npz", **(columns | {"v": columns["v"][:-1]}))
    with pytest.raises(InvalidValueError, match=r"column 'v' has 999 rows, its time 1000"):
        imported(tmp_path / "log.npz")


def test_of_rows_with_one_time_the_last_counts_and_a_leftover_first_row_does_not(tmp_path: Path) -> None:
    columns = drive()
    doubled = {name: np.insert(values, 100, values[100]) for name, values in columns.items()}
    doubled["v"][100] = -999
    leftover = {name: np.insert(values, 0, values[-1]) for name, values in doubled.items()}
    log = imported(write(tmp_path / "log.csv", leftover))
    assert check(log, "repeated_time") == (1, "note")
    assert check(log, "first_row") == (1, "note")
    assert log.episodes.x[:, 0] == pytest.approx(speed(log.episodes.time), abs=1e-12)


def test_uneven_times_are_noted_and_resampled(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    log = imported(write(tmp_path / "log.csv", drive(np.sort(rng.uniform(0, 10, 400)))))
    assert check(log, "time_jitter")[1] == "note"
    assert log.episodes.x[:, 0] == pytest.approx(speed(log.episodes.time), abs=1e-12)


def _with(name: str, values: object) -> dict[str, np.ndarray]:
    columns = drive()
    columns[name] = np.broadcast_to(np.asarray(values, dtype=float), TIME.shape)
    return columns


@pytest.mark.parametrize(
    ("columns", "refusal"),
    [
        (_with("t", np.where(TIME > 5, TIME - 1, TIME)), r"log.csv, line 503: time goes back by 0.99 s"),
        (_with("t", 3.0), r"log.csv, line 2: time never moves"),
        (_with("r", 0.0), r"column 'r' \(yaw_rate\) is 0 throughout"),
        (_with("r", np.nan), r"column 'r' \(yaw_rate\) holds fewer than two numbers"),
        (_with("d", drive()["v"]), r"column 'd' \(steer\) is a copy of what is mapped as v_x"),
        ({"t": TIME, "v": TIME, "r": TIME**2}, r"no column 'd'"),
        (drive(TIME[:200]), r"no episode is left of 40 rows, 1 shorter than log.shortest = 2.5 s"),
    ],
)
def test_what_no_predictor_could_be_fitted_to_is_refused(
    tmp_path: Path, columns: dict[str, np.ndarray], refusal: str
) -> None:
    with pytest.raises(InvalidValueError, match=refusal):
        imported(write(tmp_path / "log.csv", columns))


def test_a_steer_that_stands_in_the_rows_that_are_kept_is_refused(tmp_path: Path) -> None:
    columns = _with("d", np.where(TIME < 1, 1.0, 2.0))
    with pytest.raises(InvalidValueError, match=r"steer is .* in all rows that are kept"):
        imported(write(tmp_path / "log.csv", columns), MAP.replace("dt = 0.05", 'dt = 0.05, keep = "v_x > 11"'))


def test_names_folders_and_patterns_are_expanded_in_a_stable_order(tmp_path: Path) -> None:
    for name in ("run_10/a.csv", "run_2/a.csv", "run_2/.hidden", "b.csv"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("1")
    names = [str(path.relative_to(tmp_path)) for path in expand([str(tmp_path / "run_*"), str(tmp_path)])]
    assert names == ["run_2/a.csv", "run_10/a.csv", "b.csv"]
    with pytest.raises(InvalidValueError, match="matches no file"):
        expand([str(tmp_path / "none_*")])
