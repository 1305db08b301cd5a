"""Where a table goes."""

from __future__ import annotations

from tests.cli.test_errors import one_line

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
