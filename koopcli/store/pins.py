"""Pins: named lists of artefacts to keep."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from koopcli.errors import UnknownNameError
from koopcli.store.files import UntrustedFileError, printable, publish, read_small, storage_errors
from koopcli.store.records import Record, is_name
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
            names = json.loads(read_small(path))["names"]
            if not isinstance(names, list) or not all(map(is_name, names)):
                raise ValueError
            found[path.stem] = names
        except (OSError, UntrustedFileError, ValueError, KeyError, TypeError, RecursionError):
            label = printable(path.stem)
            store.warn(f"the pin {label} is damaged: `koop unpin {label}`, and pin again")
    return found


def label_of(record: Record) -> str:
    """The label under which a single artefact is pinned."""
    return record.name.replace("/", "-")


def _path(store: Store, label: str) -> Path:
    return store.root / "refs" / f"{label}.json"
