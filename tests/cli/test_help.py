from __future__ import annotations

import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from koopcli.__main__ import main
from koopcli.cli.app import FIRST, whole
from koopcli.cli.reference import reference

ROOT = Path(__file__).parents[2]
TOP = whole()
COMMANDS = {
    " ".join([name, *part]): inner
    for name, command in TOP.items()
    for part, inner in (
        [([], command)] if not hasattr(command, "commands") else [([p], c) for p, c in command.commands.items()]
    )
}


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_help_with_an_example_and_every_option_says_what_it_is(name):
    command = COMMANDS[name]
    assert "Example: " in command.help
    for parameter in command.params:
        assert parameter.help, f"{name} {parameter.name}"


def test_the_command_reference_is_up_to_date():
    written = (ROOT / "docs" / "cli.md").read_text()
    assert written == reference(), "run: make docs"


@pytest.mark.parametrize("args", [[], ["--help"]])
def test_help_begins_with_commands(capsys, args):
    main(args)
    shown = capsys.readouterr().out
    for command, gives in FIRST:
        assert command in shown
        assert gives in shown
        assert shown.index(command) < shown.index("Options")


@pytest.mark.parametrize("command", [command for command, _ in FIRST[1:]])  # the tests of reproduce run the first
def test_the_first_commands_run_as_printed(folder, capsys, command):
    _, *words = shlex.split(command)
    assert main([*words, *([] if words == ["ls"] else ["--dry-run"])]) == 0
    capsys.readouterr()
    assert not (folder / "artefacts").exists()


def test_the_tour_and_the_store_know_every_command():
    text = "".join((ROOT / "docs" / f"{page}.md").read_text() for page in ("tour", "store"))
    for name in COMMANDS:
        assert f"koop {name}" in text


def test_help_needs_no_numerics():
    code = (
        "import sys; from koopcli.__main__ import main; main(['--help']); "
        "print(sorted({'numpy', 'scipy', 'h5py', 'matplotlib', 'filelock'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.endswith("[]\n")


def test_what_is_there_is_found_without_numerics(folder):
    """A cached hit costs little more than the interpreter: nothing is imported that only making needs."""
    code = (
        "import sys; from koopcli.__main__ import main; main(['fit-edmd', '--experiment', '../tiny.toml']); "
        "print(sorted({'scipy', 'matplotlib', 'multiprocessing', 'distributed', 'rich'} & set(sys.modules)))"
    )
    for _ in range(2):
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "reused" in done.stderr
    assert done.stdout.endswith("[]\n")


def test_a_fit_needs_no_pictures(folder):
    code = (
        "import sys; from koopcli.__main__ import main; "
        "main(['fit-edmd', '--experiment', '../tiny.toml']); print('matplotlib' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.endswith("False\n")


def test_version_and_module():
    done = subprocess.run([sys.executable, "-m", "koopcli", "--version"], capture_output=True, text=True, check=True)
    assert done.stdout.startswith("koop ")
