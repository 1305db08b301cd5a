"""Where and how an artefact was made: for people, never part of its key."""

from __future__ import annotations

import os
import platform
import resource
import subprocess
import sys
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from koopcli.store.code import code_digest

PACKAGES = ("koopcli", "numpy", "scipy", "h5py", "matplotlib")


def provenance(seconds: float) -> dict[str, Any]:
    """Time, host, versions, code, git state, command line, seconds and the peak memory of the process so far."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss  # kB on Linux
    return {
        "time": datetime.now(UTC).isoformat(timespec="milliseconds"),
        "host": platform.node(),
        "platform": platform.platform(),
        "cores": os.cpu_count(),
        "blas_threads": os.environ.get("OPENBLAS_NUM_THREADS"),
        "python": platform.python_version(),
        "versions": _versions(),
        "code": code_digest(),
        "git": _git(),
        "argv": [text.encode("utf-8", "backslashreplace").decode() for text in sys.argv],
        "seconds": round(seconds, 3),
        "peak_memory_mb": round(peak / 1024, 1),
    }


@cache
def _versions() -> dict[str, str]:
    versions = {}
    for package in PACKAGES:
        try:
            versions[package] = version(package)
        except PackageNotFoundError:
            continue
    return versions


@cache
def _git() -> str | None:
    """Commit of the checkout that runs, with a mark for local changes; None outside a checkout."""
    top = Path(__file__).resolve().parents[2]
    if not (top / ".git").exists():
        return None
    command = ["git", "-C", str(top), "describe", "--always", "--dirty", "--abbrev=12", "--exclude=*"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=5, check=True)
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip()
