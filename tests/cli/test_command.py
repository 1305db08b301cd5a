"""What all commands have in common."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import get_args

import pytest

import koopcli
from koopcli.__main__ import main
from koopcli.errors import InvalidValueError, UnknownNameError
from tests.cli.test_errors import one_line
from tests.cli.test_help import COMMANDS

FIRST = {"baseline": ["hold"], "plot": ["orders"], "sweep": ["--set", "fit-edmd.order=1,2"]}
LOOKED_UP = {"--experiment", "--vehicle", "--on", "--from", "--predictor"}
OF_FILES = {"import", "control"}  # commands whose argument is no name of an artefact
ENUMERATED = {"--mirror", "--set"}


def texts() -> list[tuple[str, str | None]]:
    """Every command with each argument that takes a text, and every such option in the first command that has it."""
    found: dict[object, tuple[str, str | None]] = {}
    for name, command in COMMANDS.items():
        for parameter in command.params:
            kind = parameter.type_descriptor.annotation
            if {str, Path} & {kind, *get_args(kind)}:
                argument = parameter.param_type_name == "argument"
                option = None if argument else parameter.opts[-1]
                found.setdefault((name, parameter.name) if argument else option, (name, option))
    return list(dict.fromkeys(found.values()))


@pytest.mark.parametrize(("name", "option"), texts())
def test_an_empty_text_is_refused_wherever_one_is_taken(koop, folder, name, option):
    """It is what a shell makes of a command that failed, and never means that nothing was given."""
    for blank in ("", " \t"):
        given = [*FIRST.get(name, []), *([option] if option else []), blank]
        count = sum(p.required for p in COMMANDS[name].params if p.param_type_name == "argument")
        given += ["ctu-2020"] * (count - (len(given) - (2 if option else 0)))
        done = koop(*name.split(), *given, tiny=option != "--experiment")
        named = option in LOOKED_UP or (option is None and name not in OF_FILES)
        one_line(done, 4 if named else 2 if option in ENUMERATED else 3, f"'{blank.strip()}")
    assert not (folder / "artefacts").exists()


def test_the_second_of_two_names_too(koop):
    name = koop("sample").name
    one_line(koop("diff", name, ""), 4, "the name '' is empty")
    one_line(koop("fit-edmd", koop("simulate", name).name, ""), 4, "the name '' is empty")


@pytest.mark.parametrize("name", ["", "  "])
def test_an_empty_name_in_a_notebook(name, folder):
    with pytest.raises(UnknownNameError, match="is empty"):
        koopcli.load(name)
    with pytest.raises(InvalidValueError, match="the name of the store is empty"):
        koopcli.load("sample", name)


def test_an_empty_store_in_the_environment_is_none(koop, monkeypatch, folder):
    for blank in ("", " "):
        monkeypatch.setenv("KOOP_STORE", blank)
        assert koop("sample").code == 0
    assert [path.name for path in folder.iterdir()] == ["artefacts"]


def shown(capsys, *args: str) -> str:
    assert main([*args, "--help"]) == 0
    return capsys.readouterr().out


def test_help_fills_the_lines_of_a_narrow_terminal(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setenv("TERM", "xterm")
    text = shown(capsys, "fit-edmd").partition("Arguments")[0]
    paragraph = [line.strip() for line in text.split("\n")]
    first = paragraph.index(next(line for line in paragraph if line.startswith("With --terms bilinear")))
    lines = paragraph[first : paragraph.index("", first)]
    assert len(lines) > 2
    for line, following in pairwise(lines):
        assert len(line) + 1 + len(following.split()[0]) > 78, "the first word of the next line had room in this one"


def test_flags_show_no_value(capsys):
    for command in ([], ["evaluate"], ["verify"], ["vehicle", "ls"]):
        assert "<bool>" not in shown(capsys, *command)
