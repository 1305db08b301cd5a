"""What an artefact was made from, as a tree."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from koopcli.cli.invocation import brief, open_store, print_json

if TYPE_CHECKING:
    from rich.tree import Tree

    from koopcli.stages.lineage import Ancestor

UNCUT = 100_000  # letters of a line that is not for a terminal


def show_lineage(name: str, store: Path | None, as_json: bool) -> None:
    """Print the artefact ``name`` and all behind it, from their records alone."""
    from koopcli.stages.lineage import lineage

    console, shelf = open_store(store)
    found = lineage(shelf.find(name), shelf)
    if as_json:
        print_json(_described(found))
        return
    console.note(f"store: {shelf.root}")
    from rich.console import Console
    from rich.tree import Tree

    tree = Tree(_label(found))
    _grow(tree, found)
    Console(file=sys.stdout, width=None if sys.stdout.isatty() else UNCUT).print(tree)


def _grow(tree: Tree, one: Ancestor) -> None:
    for inner in one.inputs:
        _grow(tree.add(_label(inner)), inner)


def _label(one: Ancestor) -> Any:
    from rich.text import Text

    from koopcli.store.files import size_text
    from koopcli.text import printable

    words = [_name(one)]
    if one.record is not None:
        words.append(size_text(one.record.size) if one.state == "present" else one.state)
        words.append(brief(dict(one.record.recipe["settings"])))
    else:
        words.append(one.state)
    return Text(printable("  ".join([f"{one.role}: {words[0]}" if one.role else words[0], *words[1:]]).rstrip()))


def _described(one: Ancestor) -> dict[str, Any]:
    known = one.record
    about = {"bytes": known.size, "settings": known.recipe["settings"]} if known is not None else {}
    return {
        "name": _name(one),
        "state": one.state,
        **about,
        "inputs": {inner.role: _described(inner) for inner in one.inputs},
    }


def _name(one: Ancestor) -> str:
    from koopcli.store.names import short_name

    return short_name(one.full)
