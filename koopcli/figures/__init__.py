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

PLAIN = (
    *(f"config/{module}" for module in ("experiment", "pictures", "settings")),
    *("errors", "records", "simulation/samples/", "koopman/eigen/fit", "koopman/eigen/windows"),
)  # what is taken of these is data, not something drawn
IMPORTED = re.compile(r"^from koopcli\.([\w.]+) import", re.M)
NAMES = sorted(path.stem.replace("_", "-") for path in Path(__file__).parent.glob("[!_.]*.py"))


def module_of(name: str) -> Any:
    """The module of the figure ``name``; matplotlib waits until that draws."""
    return import_module(f"koopcli.figures.{name.replace('-', '_')}")


@cache
def source_digest(name: str) -> str:
    """Digest of the code that draws the figure ``name``, and of the modules that it takes numbers from.

    It is part of a figure's recipe, since no test compares pictures.
    """
    digest = hashlib.sha256()
    for path in drawing_code(name):
        digest.update(path.name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


def drawing_code(name: str) -> list[Path]:
    """The file of a figure, all of ``kit``, and the modules that the figure computes with, not what those import."""
    here = Path(__file__).parent
    own = here / f"{name.replace('-', '_')}.py"
    taken = {module.replace(".", "/") for module in IMPORTED.findall(own.read_text())}
    elsewhere = sorted(module for module in taken if not module.startswith((*PLAIN, "figures/kit")))
    return [own, *sorted((here / "kit").glob("*.py")), *(here.parent / f"{module}.py" for module in elsewhere)]
