"""Stores that several tests begin with: each is made once a run, and linked into the folder of every test.

Objects and records are never written in place, so that links are as good as copies. A test that damages files makes
its own.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from filelock import FileLock

KEPT = ("records", "objects")  # neither locks nor pins: those belong to whoever works


def obtain(root: Path, experiment: str, name: str, commands: Sequence[Sequence[str]]) -> Path:
    """The store ``name`` under ``root``, in which ``commands`` were run with an ``experiment`` (its text).

    The first to ask makes it, in whatever process of the run; the others wait. What the last command printed stands
    beside it, in ``name.out``.
    """
    store = root / name
    with FileLock(root / f"{name}.lock"):
        if not (root / f"{name}.out").exists():
            file = root / f"{name}.toml"
            file.write_text(experiment)
            for command in commands:
                words = [sys.executable, "-m", "koopcli", *command, "--experiment", str(file), "--store", str(store)]
                done = subprocess.run(words, capture_output=True, text=True, check=False)
                assert done.returncode == 0, done.stderr
            (root / f"{name}.out").write_text(done.stdout)
    return store


def link(store: Path, target: Path, without: Sequence[str] = ()) -> None:
    """Begin the store ``target`` with the artefacts of another, but for those of the stages ``without``."""
    for part in KEPT:
        for file in (store / part).rglob("*"):
            name = file.relative_to(store)
            if file.is_file() and not (part == "records" and name.parts[1] in without):
                (target / name).parent.mkdir(parents=True, exist_ok=True)
                os.link(file, target / name)
