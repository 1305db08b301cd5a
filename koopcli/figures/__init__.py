"""Figures: plain records in, a matplotlib figure out."""

import hashlib
from functools import cache
from pathlib import Path


@cache
def source_digest() -> str:
    """Digest of the code that draws. It is part of a figure's recipe, since no test compares pictures."""
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(path.name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()
