"""Real processes: killed, interrupted, terminated, racing, and on a terminal."""

from __future__ import annotations

import os
import pty
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from koopcli.store import Store
from tests.conftest import read_all

KOOP = [sys.executable, "-m", "koopcli"]
BOX = ["--set", "sample.kind=box", "--set", "sample.count=600", "--set", "sample.steps=30"]
LONG = ["simulate", "--experiment", "../tiny.toml", *BOX, "--set", "simulate.chunk=300"]  # 60 chunks
PATIENCE = 600  # seconds, with whatever else the machine does
KILLS = 8


def start(folder: Path, *args: str, **options) -> subprocess.Popen:
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    return subprocess.Popen(
        [*KOOP, *args],
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        **options,
    )


def wait_for_chunks(folder: Path, count: int, seconds: float = PATIENCE) -> int:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        found = len(list((folder / "artefacts" / "partial").glob("*/*.h5")))
        if found >= count:
            return found
        time.sleep(0.005)
    raise AssertionError("no chunk was committed")


@pytest.mark.parametrize(
    ("sent", "code"), [(signal.SIGINT, 130), pytest.param(signal.SIGTERM, 143, marks=pytest.mark.slow)]
)
def test_interrupted_it_says_how_to_go_on_and_does(folder, sent, code):
    process = start(folder, *LONG)
    wait_for_chunks(folder, 3)
    process.send_signal(sent)
    out, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == code
    assert err.splitlines()[-1].endswith("run the same command again to resume")
    assert "Traceback" not in err
    assert out == ""
    left = wait_for_chunks(folder, 1)
    again = start(folder, *LONG)
    out, err = again.communicate(timeout=PATIENCE)
    assert again.returncode == 0
    assert f"{left} of 60 chunks were already there" in err
    assert not list((folder / "artefacts" / "partial").iterdir())


@pytest.mark.slow
def test_killed_at_any_moment_it_loses_nothing_and_ends_the_same(folder, tmp_path):
    rng = random.Random(12)
    kept: set[tuple[str, str]] = set()
    for _ in range(KILLS):
        process = start(folder, *LONG)
        time.sleep(rng.uniform(0.2, 1.5))
        process.kill()
        process.communicate()
        if (folder / "artefacts").exists():
            read_all(folder / "artefacts")
            now = set(Store(folder / "artefacts").index())
            assert kept <= now
            kept = now
    survivor = start(folder, *LONG)
    name = survivor.communicate(timeout=PATIENCE)[0].strip()
    straight = start(folder, *LONG, "--store", str(tmp_path / "straight"))
    assert straight.communicate(timeout=PATIENCE)[0].strip() == name
    objects = [Store(root).find(name).object for root in (folder / "artefacts", tmp_path / "straight")]
    assert objects[0] == objects[1]


@pytest.mark.slow
def test_two_terminals_make_one_artefact_once(folder):
    both = [start(folder, *LONG) for _ in range(2)]
    done = [process.communicate(timeout=PATIENCE) for process in both]
    assert [process.returncode for process in both] == [0, 0]
    assert done[0][0] == done[1][0]
    made = [line.split()[0] for _, err in done for line in err.splitlines() if "made in" in line]
    assert sorted(made) == sorted(set(made))
    assert read_all(folder / "artefacts") == len(made) == 2


def test_bars_on_a_terminal_and_nothing_of_them_on_stdout(folder):
    ours, theirs = pty.openpty()
    command = [*KOOP, "evaluate", "--experiment", "../tiny.toml", "--workers", "2"]
    environment = {**os.environ, "TERM": "xterm"}
    with subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=theirs, env=environment) as process:
        os.close(theirs)
        shown = b""
        while True:
            try:
                part = os.read(ours, 65536)
            except OSError:  # the other end has closed
                break
            shown += part
        out, _ = process.communicate(timeout=PATIENCE)
    os.close(ours)
    assert process.returncode == 0
    assert out.decode().startswith("evaluate/")
    assert out.count(b"\n") == 1
    assert b"\x1b[2K" in shown  # the line of a bar is cleared
    assert b"RMSE in %" in shown


def test_a_closed_pipe_is_silent(folder):
    with start(folder, "ls", "--json") as process:
        process.stdout.close()
        err = process.stderr.read()
    assert err == ""
    assert process.returncode == 0


def shell(folder: Path, command: str) -> subprocess.CompletedProcess:
    return subprocess.run(
        ["bash", "-c", command.replace("koop", f"{sys.executable} -m koopcli")],
        cwd=folder, capture_output=True, text=True, check=False,
    )  # fmt: skip


def test_odd_streams_are_no_internal_error(folder):
    full = shell(folder, "koop ls --json >/dev/full")
    assert full.returncode == 6
    assert full.stderr == "koop: cannot write the output: No space left on device\n"
    for command in (
        "koop ls >&-",
        "koop sample --experiment ../tiny.toml 2>&-",
        "PYTHONIOENCODING=latin-1 koop --help",
        "LC_ALL=C PYTHONUTF8=0 koop ls --help",
        "koop sample --store $'bad\\xff' --experiment ../tiny.toml",
    ):
        done = shell(folder, command)
        assert done.returncode == 0, (command, done.stderr)
        assert "Traceback" not in done.stderr


def test_an_early_interrupt_is_answered_like_a_late_one(folder):
    """From the first import of ours on; before that the interpreter itself answers."""
    code = (
        "import sys, signal, os; import koopcli.__main__ as m; "
        "sys.meta_path.insert(0, type('F', (), {'find_spec': staticmethod("
        "lambda name, *a: os.kill(os.getpid(), signal.SIGINT) if name == 'typer' else None)})); "
        "sys.exit(m.main(['ls']))"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 130
    assert done.stderr == "koop: interrupted: nothing committed is lost; run the same command again to resume\n"
