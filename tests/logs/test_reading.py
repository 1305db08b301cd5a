"""Files of every kind: what is read of them, and what is refused with its place."""

from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io

from koopcli.errors import InvalidValueError
from koopcli.logs.entries import Source
from koopcli.logs.formats import open_table
from koopcli.logs.formats.table import Table
from koopcli.logs.text import read_columns, read_text, sniff

Write = Callable[[str, str], Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def write(name: str, content: str) -> Path:
        path = tmp_path / name
        path.write_text(content, encoding="utf-8", newline="")
        return path

    return write


def values(path: Path) -> list[list[float]]:
    return [list(row) for row in read_text(path, sniff(path))[1].tolist()]


@pytest.mark.parametrize(
    ("text", "names", "units", "rows"),
    [
        ("t,v\n0,1\n1,2\n", ("t", "v"), ("", ""), [[0, 1], [1, 2]]),
        ("0,1\n1,2\n", ("", ""), ("", ""), [[0, 1], [1, 2]]),
        (
            "# t [s], vx(m/s), r <deg/s>\n0,1,2\n1,2,3\n",
            ("t", "vx", "r"),
            ("s", "m/s", "deg/s"),
            [[0, 1, 2], [1, 2, 3]],
        ),
        (
            "# run 7\n# t v r\n# s m/s rad/s\n0 1 2\n1 2 3\n",
            ("t", "v", "r"),
            ("s", "m/s", "rad/s"),
            [[0, 1, 2], [1, 2, 3]],
        ),
        ("t;v\ns;km/h\n0,5;1,5\n0,6;1e-011\n", ("t", "v"), ("s", "km/h"), [[0.5, 1.5], [0.6, 1e-11]]),
        ('t,v\n"0,1"\n"1,2"\n', ("t", "v"), ("", ""), [[0, 1], [1, 2]]),
        (",s,V\r\n0,5,1.5\r\n0,6,2.5\r\n", ("", "s", "V"), ("", "", ""), [[0, 5, 1.5], [0, 6, 2.5]]),
        ("Time (s)  v\n0.0  1\n1.0  2\n", ("Time", "v"), ("s", ""), [[0, 1], [1, 2]]),
        ("a title\n\nt\tv\n1\t2\n2\t3", ("t", "v"), ("", ""), [[1, 2], [2, 3]]),
        ('t,z,z\n1,"""5""",7\n2,6,8\n', ("t", "z", "z"), ("", "", ""), [[1, 5, 7], [2, 6, 8]]),
        ("v r\nx 1 2\ny 2 3\n", ("", "v", "r"), ("", "", ""), [["x", 1, 2], ["y", 2, 3]]),
        ("% t, v\n% one more\n0, 1\n1, 2\n", ("t", "v"), ("", ""), [[0, 1], [1, 2]]),
        ("1,5\n2,6\n", ("", ""), ("", ""), [[1, 5], [2, 6]]),
        ("\ufefft,v\n0,1\n1,2\n", ("t", "v"), ("", ""), [[0, 1], [1, 2]]),
    ],
)
def test_the_layout_of_a_text_is_seen(
    write: Write, text: str, names: tuple[str, ...], units: tuple[str, ...], rows: list[list[float]]
) -> None:
    path = write("log.csv", text)
    layout = sniff(path)
    assert (layout.names, layout.units) == (names, units)
    assert values(path) == rows


def test_header_and_units_row_count_the_lines_of_the_file_from_one(write: Write) -> None:
    path = write("log.txt", "# a b\n# t v\n# of the clock\n# s km/h\n0 1\n1 2\n")
    layout = sniff(path, header=2, units_row=4)
    assert (layout.header, layout.names, layout.units) == (2, ("t", "v"), ("s", "km/h"))


def test_empty_fields_and_words_for_missing_values_are_nan(write: Write) -> None:
    path = write("log.csv", "t,v,w\n0,,1\n1,2,\n2,N/A,3\n,4,5\n")
    assert np.array_equal(
        read_text(path, sniff(path))[1],
        [[0, np.nan, 1], [1, 2, np.nan], [2, np.nan, 3], [np.nan, 4, 5]],
        equal_nan=True,
    )


def test_text_in_a_number_is_refused_with_file_line_and_column(write: Write) -> None:
    path = write("log.csv", "t,v\n0,1\n\n1,2\n2,fast\n")
    with pytest.raises(InvalidValueError, match=r"log.csv, line 5, column 'v': 'fast' is not a number"):
        read_columns(path, sniff(path), [0, 1])
    assert read_columns(path, sniff(path), [0])[0].tolist() == [0, 1, 2]


def test_a_line_that_is_too_short_is_refused_but_a_last_one_that_was_cut_off_is_left_out(write: Write) -> None:
    path = write("short.csv", "t,v\n0,1\n1\n2,3\n")
    with pytest.raises(InvalidValueError, match=r"short.csv, line 3 has 1 fields"):
        read_columns(path, sniff(path), [1])
    cut = write("cut.csv", "t,v\n0,1\n1,2\n2.")
    assert read_columns(cut, sniff(cut), [0])[0].tolist() == [0, 1]


@pytest.mark.parametrize("content", ["", "\n\n", "t,v\nfast,slow\n"])
def test_a_file_without_numbers_is_refused(write: Write, content: str) -> None:
    with pytest.raises(InvalidValueError, match=r"log.csv (is empty|holds no row of numbers)"):
        open_table(write("log.csv", content))


def test_columns_are_known_by_name_number_and_place_among_equals(write: Write) -> None:
    table = open_table(write("log.csv", "t,z,z,vx (m/s)\n0,1,2,3\n1,2,3,4\n"))
    assert [table.place(column) for column in ("z#1", "z#2", 2, "vx", "vx(m/s)", "# t")] == [1, 2, 2, 3, 3, 0]
    for column, refusal in (
        ("z", "2 columns 'z': write 'z#1' to 'z#2'"),
        ("z#3", "'z#3' is none of them"),
        ("vy", "no column 'vy': did you mean 'vx'"),
        (4, "number 4, counted from 0, is none"),
    ):
        with pytest.raises(InvalidValueError, match=r".*") as error:
            table.place(column)
        assert refusal in str(error.value)


def test_an_axis_is_a_column_of_three(write: Write) -> None:
    table = open_table(write("log.csv", "t,w_x,w_y,w_z,g,g,g\n0,1,2,3,4,5,6\n1,1,2,3,4,5,6\n"))
    assert [table.of_axis(column, 2) for column in ("w", "g", 1, None)] == [3, 6, 3, 2]


TIME = np.arange(5) * 0.1
SPEED = np.arange(5.0) ** 2
GYRO = np.arange(15.0).reshape(5, 3)


def check_arrays(table: Table) -> None:
    assert table.names.count("gyro") == 3
    wanted = [table.place("t"), table.place("v"), table.place("gyro#3")]
    assert table.time_place() == wanted[0]
    for got, expected in zip(table.read(wanted), (TIME, SPEED, GYRO[:, 2]), strict=True):
        assert got.tolist() == expected.tolist()


def test_arrays_of_numpy_are_known_by_their_first_bytes(tmp_path: Path) -> None:
    with (tmp_path / "value").open("wb") as stream:
        np.save(stream, GYRO)
    assert open_table(tmp_path / "value").read([2])[0].tolist() == GYRO[:, 2].tolist()
    np.savez(tmp_path / "log.npz", t=TIME, v=SPEED, gyro=GYRO, name="car")
    check_arrays(open_table(tmp_path / "log.npz"))


def test_hdf5_and_mat_hold_columns_by_name(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["t"], file["v"], file["gyro"], file["name"] = TIME, SPEED, GYRO, "car"
        file["v"].attrs["units"] = "km/h"
    table = open_table(tmp_path / "log.h5")
    check_arrays(table)
    assert table.units[table.place("v")] == "km/h"
    scipy.io.savemat(tmp_path / "old.mat", {"t": TIME, "v": SPEED, "gyro": GYRO, "s": {"a": SPEED}, "name": "car"})
    check_arrays(open_table(tmp_path / "old.mat"))
    assert open_table(tmp_path / "old.mat").place("s.a") >= 0
    with h5py.File(tmp_path / "new.mat", "w", userblock_size=512) as file:
        file["t"], file["v"], file["gyro"] = TIME[None], SPEED[None], GYRO.T
    with (tmp_path / "new.mat").open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file")
    check_arrays(open_table(tmp_path / "new.mat"))


@pytest.mark.parametrize(
    ("name", "begins", "extra"),
    [("a.mf4", b"MDF     4.10", "mdf"), ("a.bag", b"#ROSBAG V2.0", "ros"), ("a.parquet", b"PAR1", "parquet")],
)
def test_a_format_whose_library_is_missing_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, begins: bytes, extra: str
) -> None:
    for module in ("asammdf", "rosbags", "rosbags.highlevel", "pyarrow", "pyarrow.parquet"):
        monkeypatch.setitem(__import__("sys").modules, module, None)
    (tmp_path / name).write_bytes(begins + bytes(50))
    with pytest.raises(InvalidValueError, match=rf'{name} needs .*pip install "koopcli\[{extra}\]"'):
        open_table(tmp_path / name)


def test_damaged_files_are_refused_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "log.npz").write_bytes(b"PK\x03\x04" + bytes(40))
    (tmp_path / "log.npy").write_bytes(b"\x93NUMPY" + bytes(40))
    (tmp_path / "log.h5").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(40))
    (tmp_path / "log.mat").write_bytes(b"MATLAB 5.0" + bytes(200))
    (tmp_path / "log.csv").write_bytes(bytes(range(256)))
    for name in ("log.npz", "log.npy", "log.h5", "log.mat", "log.csv"):
        with pytest.raises(InvalidValueError, match=name) as error:
            open_table(tmp_path / name)
        assert "\n" not in str(error.value)


def test_a_parquet_file_gives_its_columns(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    import pyarrow as pa
    import pyarrow.parquet as pq

    stamps = (TIME * 1e6).astype("datetime64[us]")
    pq.write_table(pa.table({"t": stamps, "v [km/h]": SPEED}), tmp_path / "log.parquet")
    table = open_table(tmp_path / "log.parquet")
    assert (table.names, table.units) == (("t", "v"), ("", "km/h"))
    assert table.read([0, 1])[0] == pytest.approx(TIME)
    assert table.read([1])[0].tolist() == SPEED.tolist()


def test_an_mdf_file_gives_each_channel_its_own_times(tmp_path: Path) -> None:
    asammdf = pytest.importorskip("asammdf")
    file = asammdf.MDF(version="4.10")
    file.append([asammdf.Signal(SPEED, TIME, name="v", unit="km/h")])
    file.append([asammdf.Signal(SPEED[:3], TIME[:3] + 1, name="r", unit="deg/s")])
    file.save(tmp_path / "log.mf4")
    table = open_table(tmp_path / "log.mf4")
    assert (table.names, table.units) == (("v", "r"), ("km/h", "deg/s"))
    assert table.stamps is not None
    assert table.read([0])[0].tolist() == SPEED.tolist()
    assert table.stamps(1) == pytest.approx(TIME[:3] + 1)


def test_a_bag_gives_the_numbers_of_each_topic_with_its_times(tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    number = store.types["std_msgs/msg/Float64"]
    with Writer(tmp_path / "log.bag") as bag:
        connection = bag.add_connection("/speed", number.__msgtype__, typestore=store)
        for time, speed in zip(TIME, SPEED, strict=True):
            bag.write(connection, int(1e9 * (time + 5)), store.serialize_ros1(number(float(speed)), number.__msgtype__))
    table = open_table(tmp_path / "log.bag")
    assert table.names == ("/speed/data",)
    assert table.read([0])[0].tolist() == SPEED.tolist()
    assert table.stamps is not None
    assert table.stamps(0) == pytest.approx(TIME + 5)


def test_what_the_map_says_of_a_layout_is_taken(write: Write) -> None:
    path = write("log.csv", "1;2\n3;4\n5;6\n")
    table = open_table(path, Source("", header=1, delimiter=";"))
    assert (table.names, table.read([1])[0].tolist()) == (("1", "2"), [4, 6])


def test_structs_of_mat_7_3_are_read_by_mat73(tmp_path: Path) -> None:
    pytest.importorskip("mat73")
    with h5py.File(tmp_path / "log.mat", "w", userblock_size=512) as file:
        group = file.create_group("car")
        group.attrs["MATLAB_class"] = np.bytes_("struct")
        for name, values in (("t", TIME), ("v", SPEED)):
            group[name] = values[None]
            group[name].attrs["MATLAB_class"] = np.bytes_("double")
    with (tmp_path / "log.mat").open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file")
    table = open_table(tmp_path / "log.mat")
    assert sorted(table.names) == ["car.t", "car.v"]
    assert table.read([table.place("car.v")])[0].tolist() == SPEED.tolist()


def test_an_index_in_brackets_is_no_unit(write: Write) -> None:
    table = open_table(write("log.csv", "t,q(0),q(1),v(furlong/h)\n0,1,2,3\n1,2,3,4\n"))
    assert table.names == ("t", "q(0)", "q(1)", "v")
    assert table.place("v(furlong/h)") == 3
