"""Pins: named lists of artefacts to keep."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from koopcli.errors import UnknownNameError
from koopcli.store.files import publish, reading_errors, storage_errors, sync_young
from koopcli.store.records import Record
from koopcli.store.store import Store
from koopcli.store.survey import pinned
from koopcli.text import printable


def pin(store: Store, label: str, records: Sequence[Record]) -> None:
    """Keep ``records`` under ``label``; writes nothing when they are there already."""
    names = sorted(f"{record.stage}/{record.key}" for record in records)
    for record in records:
        store.sync(record)
    if pins(store).get(label) == names:
        sync_young(_path(store, label))
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
            labels = ", ".join(pins(store)) or "none"
            raise UnknownNameError(f"'{label}' is not pinned (pinned: {labels})") from error


def pins(store: Store) -> dict[str, list[str]]:
    """label -> names "stage/key" that it keeps; a damaged pin keeps nothing and is warned about."""
    with reading_errors(store.root):
        by_label = pinned(store.root)
    for label, names in by_label.items():
        if names is None:
            shown = printable(label)
            store.warn(f"the pin {shown} is damaged: `koop unpin {shown}`, and pin again")
    return {label: names or [] for label, names in by_label.items()}


def label_of(record: Record) -> str:
    """The label under which a single artefact is pinned."""
    return record.name.replace("/", "-")


def _path(store: Store, label: str) -> Path:
    return store.root / "refs" / f"{label}.json"
