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
    ancestor = lineage(shelf.find(name), shelf)
    if as_json:
        print_json(_described(ancestor))
        return
    console.note(f"store: {shelf.root}")
    from rich.console import Console
    from rich.tree import Tree

    tree = Tree(_label(ancestor))
    _grow(tree, ancestor)
    Console(file=sys.stdout, width=None if sys.stdout.isatty() else UNCUT).print(tree)


def _grow(tree: Tree, ancestor: Ancestor) -> None:
    for inner in ancestor.inputs:
        _grow(tree.add(_label(inner)), inner)


def _label(ancestor: Ancestor) -> Any:
    from rich.text import Text

    from koopcli.store.files import size_text
    from koopcli.text import printable

    words = [_name(ancestor)]
    if ancestor.record is not None:
        words.append(size_text(ancestor.record.size) if ancestor.state == "present" else ancestor.state)
        words.append(brief(dict(ancestor.record.recipe["settings"])))
    else:
        words.append(ancestor.state)
    return Text(
        printable("  ".join([f"{ancestor.role}: {words[0]}" if ancestor.role else words[0], *words[1:]]).rstrip())
    )


def _described(ancestor: Ancestor) -> dict[str, Any]:
    from koopcli.stages.recorded import all_settings

    record = ancestor.record
    about = {"bytes": record.size, "settings": all_settings(record)} if record is not None else {}
    return {
        "name": _name(ancestor),
        "state": ancestor.state,
        **about,
        "inputs": {inner.role: _described(inner) for inner in ancestor.inputs},
    }


def _name(ancestor: Ancestor) -> str:
    from koopcli.store.names import short_name

    return short_name(ancestor.full)
