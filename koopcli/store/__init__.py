"""The artefact store: identity by recipe, content by digest, commit, verified read, and looking after it."""

from koopcli.store.records import Record
from koopcli.store.store import Store, store_root

__all__ = ["Record", "Store", "store_root"]
