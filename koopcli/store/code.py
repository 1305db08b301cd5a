"""Which code this koop is: a digest of its sources, kept beside what they make and never part of a key."""

from __future__ import annotations

import hashlib
import os
from functools import cache
from pathlib import Path

SHORT = 12  # digits of the digest in a text


@cache
def code_digest() -> str:
    """The digest of this koop's sources, as they are when it is first asked for: once a process, and not in vain."""
    return digest_of(Path(__file__).resolve().parents[1])


def digest_of(package: Path) -> str:
    """The digest of every Python file below ``package`` with its path from there: a wheel and a checkout agree."""
    digest = hashlib.sha256()
    for path in sorted(_sources(str(package))):
        with open(os.path.join(package, path), "rb") as file:
            content = file.read()
        digest.update(f"{path}\0{len(content)}\0".encode() + content)
    return digest.hexdigest()


def _sources(package: str) -> list[str]:
    """The Python files below ``package``, each as its path from there; not what an editor hides beside them."""
    return [
        os.path.join(folder, name)[len(package) + 1 :]
        for folder, _, names in os.walk(package)
        for name in names
        if name.endswith(".py") and not name.startswith(".")
    ]
