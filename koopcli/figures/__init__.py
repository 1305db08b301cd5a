"""Figures: plain records in, a matplotlib figure out. Every file of this folder is a figure, called as the file is.

``FIGURE`` says what it shows, takes and makes; ``select(sources, settings)`` gathers what it shows in a small record,
``numbers(shown)`` gives that as columns, ``draw(shown)`` as a matplotlib figure. What figures share is in ``kit``.
"""

import hashlib
import re
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

# what is taken of these is data, not something drawn
PLAIN = (
    "config/experiment",
    "config/settings",
    "errors",
    "records",
    "simulation/samples/",
    "koopman/eigen/fit",
    "koopman/eigen/windows",
)
NAMES = sorted(path.stem.replace("_", "-") for path in Path(__file__).parent.glob("[!_.]*.py"))


def module_of(name: str) -> Any:
    """The module of the figure ``name``; matplotlib waits until that draws."""
    return import_module(f"koopcli.figures.{name.replace('-', '_')}")


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
    own = sorted(here.rglob("*.py"))
    taken = {
        name.replace(".", "/")
        for path in own
        for name in re.findall(r"^from koopcli\.([\w.]+) import", path.read_text(), re.M)
    }
    elsewhere = sorted(name for name in taken if not name.startswith((*PLAIN, "figures")))
    return [*own, *(here.parent / f"{name}.py" for name in elsewhere)]
