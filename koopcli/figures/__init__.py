"""Figures: plain records in, a matplotlib figure out. Every file of this folder is a figure, called as the file is.

``FIGURE`` says what it shows, takes and makes; ``select(sources, settings)`` gathers what it shows in a small record,
``numbers(shown)`` gives that as columns, ``draw(shown)`` as a matplotlib figure.
"""

import hashlib
import re
from collections.abc import Iterator, Mapping
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from koopcli.figures.common.kind import FigureKind

# what is taken of these is data, not something drawn
PLAIN = ("config/experiment", "config/samples", "config/settings", "errors", "records")


def module_of(name: str) -> Any:
    """The module of the figure ``name``; matplotlib waits until that draws."""
    return import_module(f"koopcli.figures.{name.replace('-', '_')}")


class _Folder(Mapping[str, "FigureKind"]):
    """Figures by name, each read from its file when it is asked for."""

    def __getitem__(self, name: str) -> "FigureKind":
        if name not in self._names():
            raise KeyError(name)
        kind: FigureKind = module_of(name).FIGURE
        return kind

    def __iter__(self) -> Iterator[str]:
        return iter(self._names())

    def __len__(self) -> int:
        return len(self._names())

    def __contains__(self, name: object) -> bool:
        return name in self._names()

    @staticmethod
    @cache
    def _names() -> list[str]:
        return sorted(path.stem.replace("_", "-") for path in Path(__file__).parent.glob("[!_.]*.py"))


FIGURES = _Folder()


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
    elsewhere = sorted(name for name in taken if name not in PLAIN and not name.startswith("figures"))
    return [*own, *(here.parent / f"{name}.py" for name in elsewhere)]
