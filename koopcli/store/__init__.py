"""The artefact store: identity by recipe, content by digest, commit, verified read, and looking after it."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from koopcli.store.names import store_root
    from koopcli.store.records import Record
    from koopcli.store.store import Store

__all__ = ["Record", "Store", "store_root"]


def __getattr__(name: str) -> Any:
    """What is asked for, from its module: names alone are found without h5py and numpy."""
    homes = {"Record": "records", "Store": "store", "store_root": "names"}
    if name not in homes:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{homes[name]}"), name)
