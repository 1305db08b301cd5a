"""What an artefact was made from, as its records tell: nothing is read of its content, and nothing made."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from koopcli.errors import NewerFormatError
from koopcli.store import Record, Store


@dataclass(frozen=True)
class Ancestor:
    """An artefact, what it is to the one made from it, and its own inputs. ``state``: present, missing or gone.

    The object of a missing one is not there, but its record; of one that is gone not even that.
    """

    role: str
    full: str
    record: Record | None
    state: str
    inputs: tuple[Ancestor, ...] = ()

    def behind(self, roles: str = "") -> Iterator[tuple[str, Record]]:
        """This artefact's record and all behind it, each with the roles that lead to it."""
        if self.record is not None:
            yield roles, self.record
        for ancestor in self.inputs:
            yield from ancestor.behind(f"{roles} / {ancestor.role}".removeprefix(" / "))


def lineage(record: Record, store: Store, role: str = "", below: tuple[str, ...] = ()) -> Ancestor:
    """``record`` with everything that it was made from, as far as it is in the store; ``below``: made from it."""
    full = f"{record.stage}/{record.key}"
    inputs = tuple(_input(store, role, name, (*below, full)) for role, name in record.lineage.items())
    state = "present" if store.has_object(record) else "missing"
    return Ancestor(role, full, record, state, inputs)


def _input(store: Store, role: str, full: str, below: tuple[str, ...]) -> Ancestor:
    if full in below:  # no command writes such a record
        return Ancestor(role, full, None, "made from itself")
    stage, _, key = full.partition("/")
    try:
        record = store.record(stage, key)
    except NewerFormatError:
        return Ancestor(role, full, None, "of a newer format")
    return Ancestor(role, full, None, "gone") if record is None else lineage(record, store, role, below)
