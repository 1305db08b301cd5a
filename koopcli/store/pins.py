"""Pins: named lists of artefacts to keep."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from koopcli.errors import UnknownNameError
from koopcli.store.files import publish, storage_errors
from koopcli.store.records import Record
from koopcli.store.store import Store


def pin(store: Store, label: str, records: Sequence[Record]) -> None:
    """Keep ``records`` under ``label``; writes nothing when they are there already."""
    names = sorted(f"{record.stage}/{record.key}" for record in records)
    if pins(store).get(label) == names:
        return
    with storage_errors(store.root):
        content = json.dumps({"names": names}, indent=1).encode()
        publish(_path(store, label), content, store.root / "tmp")


def unpin(store: Store, label: str) -> None:
    """Forget ``label``. Raises ``UnknownNameError`` when there is no such pin."""
    with storage_errors(store.root):
        try:
            _path(store, label).unlink()
        except FileNotFoundError as error:
            known = ", ".join(pins(store)) or "none"
            raise UnknownNameError(f"'{label}' is not pinned (pinned: {known})") from error


def pins(store: Store) -> dict[str, list[str]]:
    """label -> names "stage/key" that it keeps; a damaged pin keeps nothing and is warned about."""
    found: dict[str, list[str]] = {}
    for path in sorted((store.root / "refs").glob("*.json")):
        found[path.stem] = []
        try:
            found[path.stem] = [str(name) for name in json.loads(path.read_text())["names"]]
        except (OSError, ValueError, KeyError, TypeError):
            store.warn(f"the pin {path.stem} is damaged: `koop unpin {path.stem}`, and pin again")
    return found


def label_of(record: Record) -> str:
    """The label under which a single artefact is pinned."""
    return record.name.replace("/", "-")


def _path(store: Store, label: str) -> Path:
    return store.root / "refs" / f"{label}.json"
