"""The stages of the pipeline: the only place that knows both the numerics and the store."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from koopcli.stages.recorded import content_of
from koopcli.store import Store, store_root

__all__ = ["read"]


def read(name: str, store: str | Path | None = None) -> Any:
    """The record named ``name`` (or an unambiguous prefix), verified; see ``koopcli.load``."""
    shelf = Store(store_root(store))
    record = shelf.find(name)
    return content_of(record, shelf)
