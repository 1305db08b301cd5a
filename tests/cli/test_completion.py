"""What a shell completes, asked for as bash asks."""

from __future__ import annotations

import subprocess
import sys

import pytest

from koopcli.__main__ import main
from koopcli.cli import completion
from koopcli.figures import NAMES


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
    assert complete("plot", "") == NAMES
    assert complete("plot", "best") == ["best-order"]
    assert complete("ls", "fit") == ["fit-edmd", "fit-eigen"]
    assert complete("evaluate", "--experiment", "sm") == ["smoke"]
    assert complete("simulate", "--vehicle", "bmw") == ["bmw-320i"]
    assert complete("vehicle", "show", "bmw") == ["bmw-320i"]
    assert complete("evaluate", "--experiment", "./sm") == []  # files are the shell's


def test_settings_complete_with_their_values(complete, folder):
    assert complete("fit-edmd", "--set", "fit-edmd.o") == ["fit-edmd.order="]
    assert complete("sweep", "--set", "vehicle.l_") == ["vehicle.l_f=", "vehicle.l_r="]
    assert complete("fit-edmd", "--set", "fit-edmd.basis.thin") == [
        f"fit-edmd.basis.thin-plate.{name}=" for name in ("centres", "placement", "seed")
    ]
    assert complete("fit-eigen", "--set", "fit-eigen.lift=") == [
        f"fit-eigen.lift={kind}" for kind in ("linear", "mls", "nearest", "polyharmonic")
    ]
    assert complete("fit-eigen", "--set", "fit-eigen.trust=t") == ["fit-eigen.trust=true"]
    assert complete("fit-edmd", "--set", "fit-edmd.nonsense") == []
    assert complete("fit-edmd", "--set", "fit-edmd.order=") == []


def test_artefacts_complete_in_the_store_that_is_named(complete, koop, folder):
    name, other = koop("sample").name, koop("sample", "--store", "elsewhere", "--seed", "5").name
    for command in (["show"], ["simulate"], ["evaluate", "--on"], ["plot", "energy-surface"]):
        assert complete(*command, "sam") == [name]
    assert complete("show", "--store", "elsewhere", "sam") == [other]
    fit = koop("fit-edmd").name
    for figure, names in (("spectrum", [fit]), ("energy-surface", [name]), ("orders", []), ("tyre", [])):
        assert complete("plot", figure, "") == names
    assert set(complete("plot", "no-such-figure", "")) >= {name, fit}
    (folder / "artefacts" / "records" / "\x1b[2J").mkdir()
    assert complete("show", "eval") == []


def test_a_store_that_cannot_be_read_has_no_names(complete, folder):
    (folder / "artefacts").mkdir()
    (folder / "artefacts" / "records").write_text("")
    assert complete("show", "s") == []
    assert complete("show", "--store", "~nouser/x", "s") == []


@pytest.mark.parametrize(
    ("words", "unneeded"),
    [
        ("koop show sample", {"numpy"}),
        ("koop plot err", {"numpy"}),
        ("koop plot error-map eval", set()),  # what a figure takes stands in its file
    ],
)
def test_completion_needs_no_numerics(folder, words, unneeded):
    code = (
        "import sys; from koopcli.__main__ import main; main([]); "
        f"print(sorted({unneeded | {'scipy', 'h5py', 'matplotlib', 'filelock'}!r} & set(sys.modules)))"
    )
    asked = {"COMP_WORDS": words, "COMP_CWORD": str(words.count(" ")), "_KOOP_COMPLETE": "complete_bash"}
    done = subprocess.run([sys.executable, "-c", code], env=asked, capture_output=True, text=True, check=True)
    assert done.stdout.endswith("[]\n")
