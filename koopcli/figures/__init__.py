"""Figures: plain records in, a matplotlib figure out."""

import hashlib
import re
from functools import cache
from pathlib import Path

PLAIN = ("config/settings", "errors", "records")  # what is taken of these is data, not something drawn


@cache
def source_digest() -> str:
    """Digest of the code that draws, and of the modules it takes numbers from.

    It is part of a figure's recipe, since no test compares pictures.
    """
    digest = hashlib.sha256()
    for path in drawing_code():
        digest.update(path.name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


def drawing_code() -> list[Path]:
    """The files of this package, then those elsewhere in koopcli that they import from."""
    here = Path(__file__).parent
    own = sorted(here.glob("*.py"))
    taken = {
        name.replace(".", "/")
        for path in own
        for name in re.findall(r"^from koopcli\.([\w.]+) import", path.read_text(), re.M)
    }
    elsewhere = sorted(name for name in taken if name not in PLAIN and not name.startswith("figures"))
    return [*own, *(here.parent / f"{name}.py" for name in elsewhere)]
