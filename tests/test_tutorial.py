"""The tutorial on one's own logs keeps its word: commands run in an empty folder, lines are printed as shown."""

from __future__ import annotations

import re
import shutil
import subprocess

import pytest

from koopcli.config.data import data_folder
from tests.test_readme import NAME, ROOT, masked, run

PAGE = (ROOT / "docs" / "own-data.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```console\n(.*?)```", PAGE, re.DOTALL)
QUOTES = [re.sub(r"\n> ?", " ", quote).removeprefix("> ") for quote in re.findall(r"(?:^> .*\n)+", PAGE, re.MULTILINE)]
SHORT = re.compile(r"\b[a-z-]+/[0-9a-f]{4}\b")
MOST_LINES = 220


def _session(block):
    """Each command of a block with the lines shown under it."""
    commands = re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]
    for command, *shown in map(str.splitlines, commands):
        yield command, [line for line in shown if line != "…"]


@pytest.fixture
def told(koop, folder):
    """Run a command of the page here and check the lines shown under it. What was printed by all of them is kept.

    A name that is shown stands for the one that is printed in its place.
    """
    shutil.copytree(data_folder() / "logs" / "simulated", folder / "simulated")
    printed: list[str] = []
    names: dict[str, str] = {}

    def named(short):
        full = [name for name in names if name.startswith(short.group())]
        assert len(full) == 1, f"{short.group()} is not shown, or several are"
        return names[full[0]]

    def heard(*words, tiny):
        done = koop(*words, tiny=tiny)
        printed.extend(f"{done.out}\n{done.err}".splitlines())
        return done

    def follow(command, shown):
        if not command.startswith("koop "):
            subprocess.run(command, shell=True, check=True, cwd=folder)
            return
        before = len(printed)
        run(heard, [(SHORT.sub(named, command), shown)], small=False)
        there = {masked(line, numbers=False): line for line in printed[before:]}
        for line in shown:
            pairs = zip(NAME.finditer(line), NAME.finditer(there[masked(line, numbers=False)]), strict=True)
            names.update((wanted.group(), found.group()) for wanted, found in pairs)

    return follow, printed


@pytest.mark.slow  # ten seconds of commands, which other tests run in small
def test_commands_print_what_is_shown(told):
    follow, printed = told
    for block in BLOCKS:
        for command, shown in _session(block):
            follow(command, shown)
    assert QUOTES
    assert {masked(quote, numbers=False) for quote in QUOTES} <= {masked(line, numbers=False) for line in printed}


def test_it_is_short():
    assert len(PAGE.splitlines()) <= MOST_LINES
