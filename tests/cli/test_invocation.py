from __future__ import annotations

import io
import json
import sys

from koopcli.cli.invocation import brief, print_json, write_csv


class Table:
    """A table with a name that would clear the screen."""

    def table(self):
        return ["a\x1b[2J", "b"], [[1.5, None]]


def test_a_table_is_exact_but_on_a_terminal():
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    for file, name in ((io.StringIO(), "a\x1b[2J"), (Terminal(), "a�[2J")):
        write_csv(Table(), file)
        assert file.getvalue() == f"{name},b\n1.5,\n"


def test_json_is_exact_and_steers_nothing(monkeypatch):
    file = io.StringIO()
    monkeypatch.setattr(sys, "stdout", file)
    value = {"Γ\x7f": ["a\x9b2J", "b\u202e", "z⁺\n"]}
    print_json(value)
    assert file.getvalue().replace("\n", "").isprintable()
    assert "Γ" in file.getvalue()
    assert json.loads(file.getvalue()) == value


def test_a_digest_is_no_setting_to_show():
    assert brief({"figure": "orders", "drawn_by": "0f" * 32, "series": ()}) == "figure=orders"
