"""What a shell completes, asked for as bash asks."""

from __future__ import annotations

import subprocess
import sys
from typing import get_args

import pytest

from koopcli.__main__ import main
from koopcli.cli import completion
from koopcli.config.pictures import FigureName


@pytest.fixture
def complete(monkeypatch, capsys):
    def ask(*words: str) -> list[str]:
        monkeypatch.setenv("COMP_WORDS", " ".join(["koop", *words]))
        monkeypatch.setenv("COMP_CWORD", str(len(words)))
        with monkeypatch.context() as asked:
            asked.setenv("_KOOP_COMPLETE", "complete_bash")
            assert main([]) == 0
        captured = capsys.readouterr()
        assert captured.err == ""
        return captured.out.split()

    return ask


def test_all_stages_are_known_to_the_completion():
    from koopcli.stages.registry import STAGES

    assert sorted(completion.STAGES) == sorted(STAGES)


def test_names_that_never_change_complete(complete, folder):
    assert complete("plot", "") == list(get_args(FigureName))
    assert complete("plot", "best") == ["best-order"]
    assert complete("ls", "fit") == ["fit-edmd", "fit-eigen"]
    assert complete("evaluate", "--experiment", "sm") == ["smoke"]
    assert complete("simulate", "--vehicle", "bmw") == ["bmw-320i"]
    assert complete("vehicle", "show", "bmw") == ["bmw-320i"]
    assert complete("evaluate", "--experiment", "./sm") == []  # files are the shell's


def test_artefacts_complete_in_the_store_that_is_named(complete, koop, folder):
    name, other = koop("sample").name, koop("sample", "--store", "elsewhere", "--seed", "5").name
    for command in (["show"], ["simulate"], ["evaluate", "--on"], ["plot", "orders"]):
        assert complete(*command, "sam") == [name]
    assert complete("show", "--store", "elsewhere", "sam") == [other]
    (folder / "artefacts" / "records" / "\x1b[2J").mkdir()
    assert complete("show", "fit") == []


def test_a_store_that_cannot_be_read_has_no_names(complete, folder):
    (folder / "artefacts").mkdir()
    (folder / "artefacts" / "records").write_text("")
    assert complete("show", "s") == []
    assert complete("show", "--store", "~nouser/x", "s") == []


def test_completion_needs_no_numerics(folder):
    code = (
        "import sys; from koopcli.__main__ import main; main([]); "
        "print(sorted({'numpy', 'scipy', 'h5py', 'matplotlib', 'filelock'} & set(sys.modules)))"
    )
    asked = {"COMP_WORDS": "koop show sample", "COMP_CWORD": "2", "_KOOP_COMPLETE": "complete_bash"}
    done = subprocess.run([sys.executable, "-c", code], env=asked, capture_output=True, text=True, check=True)
    assert done.stdout.endswith("[]\n")
