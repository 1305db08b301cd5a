"""Where a table goes."""

from __future__ import annotations

from stat import S_IMODE

from koopcli.cli.outputs import write_outputs
from koopcli.console import Console
from tests.cli.test_errors import one_line
from tests.powercut.disk import disk_of, operations, states
from tests.powercut.recorder import Events, recording

SWEEP = ["sweep", "--set", "fit-edmd.order=1,2"]


def test_a_table_on_stdout_is_all_of_it(koop, folder):
    named = koop("plot", "tyre", "--csv", "tyre.csv")
    shown = koop("plot", "tyre", "--csv", "-")
    assert shown.code == 0
    assert shown.out == (folder / "tyre.csv").read_text()
    assert shown.err.splitlines()[-1] == named.name
    assert not (folder / "-").exists()


def test_stdout_takes_one_thing(koop, folder):
    for command in (["plot", "tyre"], SWEEP):
        one_line(koop(*command, "--csv", "-", "--json"), 2, "--csv - and --json")
    one_line(koop("show", "evaluate/0", "--csv", "--json"), 2, "--csv and --json")
    assert not (folder / "artefacts").exists()


def test_a_power_cut_leaves_the_users_file_as_it_was_or_whole(tmp_path):
    path = tmp_path / "map.png"
    path.write_bytes(b"what was there")
    start, events = disk_of(tmp_path), Events()
    with recording(tmp_path, events):
        write_outputs(Console(), b"what is new", path, None, None)
    done = operations(start, events, tmp_path)
    kept = [{state.tree["map.png"] for state in states(start, done[:cut])} for cut in range(len(done) + 1)]
    assert set().union(*kept) == {b"what was there", b"what is new"}
    assert kept[-1] == {b"what is new"}


def test_a_file_that_is_replaced_keeps_its_permissions(tmp_path):
    path, new = tmp_path / "table.csv", tmp_path / "new.csv"
    path.write_text("what was here")
    usual = path.stat().st_mode
    for mode in (0o600, 0o664, 0o640):
        path.chmod(mode)
        write_outputs(Console(), b"what is new", path, None, None)
        assert path.read_bytes() == b"what is new"
        assert S_IMODE(path.stat().st_mode) == mode
    write_outputs(Console(), b"what is new", new, None, None)
    assert new.stat().st_mode == usual
