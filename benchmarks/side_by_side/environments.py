"""Who competes, and the peers' own environments: made by venv and pip where they are not there yet."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

COMPETITORS = {  # the module and class of each, and whose environment it needs: None for koop's
    "koop": ("koop_", "Koop", None),
    "pykoop": ("pykoop_", "Pykoop", "pykoop"),
    "deeptime": ("deeptime_", "Deeptime", "deeptime"),
    "deeptime, streamed": ("deeptime_", "Streamed", "deeptime"),
    "PyKoopman": ("pykoopman_", "PyKoopman", "pykoopman"),
    "datafold": ("datafold_", "Datafold", "datafold"),
    "numpy, normal equations": ("gram", "Gram", None),
    "numpy, lstsq": ("lstsq", "Lstsq", None),
}
PINS = {
    "pykoop": ("pykoop==2.0.1", "numpy==2.4.*"),
    "deeptime": ("deeptime==0.4.5", "numpy==2.4.*"),
    "pykoopman": ("pykoopman==1.2.1", "numpy==1.26.0"),
    "datafold": ("datafold==2.0.2", "numpy==1.26.*"),
}


class UnavailableError(Exception):
    """An environment could not be made; the text says why."""


def environment(folder: Path, peer: str) -> Path:
    """The Python of the ``peer``'s environment in ``folder``, which is made unless these pins are installed there.

    Raises ``UnavailableError`` where pip cannot install them.
    """
    home, wanted = folder / peer, "\n".join(PINS[peer]) + "\n"
    python, done = home / "bin" / "python", home / "installed.txt"
    if done.is_file() and done.read_text() == wanted and _runs(python):
        return python
    folder.mkdir(parents=True, exist_ok=True)
    (folder / ".gitignore").write_text("*\n")
    done.unlink(missing_ok=True)
    for step in (
        [sys.executable, "-m", "venv", "--clear", str(home)],
        [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *PINS[peer]],
    ):
        tried = subprocess.run(step, capture_output=True, text=True, check=False)
        if tried.returncode:
            errors = [line[7:] for line in tried.stderr.splitlines() if line.startswith("ERROR: ")]
            raise UnavailableError(f"cannot be installed: {errors[-1] if errors else ' '.join(step[1:3])}")
    done.write_text(wanted)
    return python


def _runs(python: Path) -> bool:
    return python.exists() and subprocess.run([python, "-c", "import numpy"], check=False).returncode == 0
