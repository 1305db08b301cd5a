"""The README keeps its word: commands run, lines are printed as shown, links lead somewhere."""

from __future__ import annotations

import re
import shlex
import shutil
from pathlib import Path

import pytest

from koopcli.config.data import data_folder

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
MOST_WORDS = 900
NAME = re.compile(r"\b([a-z-]+)/[0-9a-f]{4,12}\b")
REPORT = re.compile(r"(?<=reports/)([a-z]+)-[0-9a-f…]+(?=/)")
TIME = re.compile(r"\b\d+(\.\d+)? s\b")
MADE = re.compile(r"\b\d{4}-\d\d-\d\d \d\d:\d\d .*")  # when, in how long, how large
NUMBER = re.compile(r"\d+(\.\d+)?(e[+-]?\d+)?")
SMALL = {  # what makes a command quick, by the word that follows `koop`
    "evaluate": "--set sample.count=9 --set sample.columns=4 --set test.count=40 --set test.steps=5",
    "plot": "--set sample.count=9 --set sample.columns=4 --set test.point.steps=60",
    "sweep": "--set sample.count=9 --set sample.columns=4 --set test.count=40 --set test.steps=5",
    "reproduce": "--experiment ../tiny.toml --dry-run",
}


def _sessions():
    """The commands of each block of the README with the lines shown under them."""
    for block in re.findall(r"```console\n(.*?)```", README, re.DOTALL):
        session = []
        for line in block.splitlines():
            if line.startswith("$ "):
                session.append((line[2:].partition("  #")[0].strip(), []))
            elif line != "…":
                session[-1][1].append(line)
        yield session


SESSIONS = list(_sessions())


def masked(text, *, numbers):
    """``text`` without what differs from run to run: names, times, blanks, and ``numbers`` where sizes differ."""
    text = MADE.sub("MADE", TIME.sub("TIME", REPORT.sub(r"\1-NAME", NAME.sub(r"\1/NAME", text))))
    text = NUMBER.sub("#", text) if numbers else text
    return " ".join(text.split())


def run(koop, session, small):
    for command, shown in session:
        program, *words = shlex.split(command)
        if program != "koop":
            continue  # `make` and `pip` are what every run of the tests begins with
        words += shlex.split(SMALL.get(words[0], "")) if small else []
        done = koop(*words, tiny=False)
        assert done.code == 0, (command, done.err)
        printed = [masked(line, numbers=small) for line in f"{done.out}\n{done.err}".splitlines()]
        if "--dry-run" in words and "--dry-run" not in command:
            continue  # at full size alone
        for line in shown:
            wanted = masked(line, numbers=small)  # a command that is advised has the options that make it quick
            assert any(told == wanted or (small and told.startswith(f"{wanted} --set")) for told in printed), (
                command, line, printed,
            )  # fmt: skip


@pytest.fixture
def my_car(folder):
    shutil.copy(data_folder() / "vehicles" / "bmw-320i.toml", folder / "my-car.toml")


@pytest.mark.parametrize("session", SESSIONS, ids=lambda session: session[0][0])
def test_commands_print_what_is_shown(koop, my_car, session):
    run(koop, session, small=True)


def test_the_command_of_the_picture_draws_it(koop, folder):
    (command,) = re.findall(r"^`(koop plot [^`]*)`\*$", README, re.MULTILINE)
    done = koop(*shlex.split(f"{command} {SMALL['plot']}")[1:], tiny=False)
    assert done.code == 0, done.err
    assert (folder / "prediction.png").read_bytes().startswith(b"\x89PNG")


def test_the_lines_of_python_run(koop):
    (block,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    (told,) = re.findall(r"x = .*# \((\d+), (\d+)\)", block)
    space = {}
    exec(re.sub(r"fit-edmd/[0-9a-f]+", koop("fit-edmd").name, block), space)
    assert space["x"].shape == tuple(map(int, told))


@pytest.mark.slow  # minutes: every command at full size
@pytest.mark.parametrize("session", SESSIONS, ids=lambda session: session[0][0])
def test_numbers_are_those_of_full_size(koop, my_car, session):
    run(koop, session, small=False)


def test_it_is_short():
    assert len(README.split()) <= MOST_WORDS


@pytest.mark.parametrize("page", [ROOT / "README.md", *sorted((ROOT / "docs").glob("**/*.md"))], ids=lambda p: p.name)
def test_links_lead_somewhere(page):
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    links = re.findall(r"\]\(([^)\s]+)\)", text)
    dead = [link for link in links if "://" not in link and not (page.parent / link.partition("#")[0]).exists()]
    assert dead == []
