"""Look for damage in a store, without touching it."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from koopcli.progress import Progress, silent
from koopcli.records import Packed
from koopcli.store import digests
from koopcli.store.files import HOUR, UntrustedFileError, open_regular, size_text
from koopcli.store.names import short_name
from koopcli.store.records import Record
from koopcli.store.store import Store
from koopcli.store.survey import Recorded, Stock, object_path, survey

DAMAGE = (
    "damaged record",
    "record put aside",
    "damaged object",
    "unreadable object",
    "missing object",
    "damaged digests",
    "unreadable digests",
    "missing digests",
    "damaged pin",
    "pin of nothing",
)


ORPHAN = "orphan object"
OTHER_FORMAT = {
    "newer": "written by a newer koop; left alone: update koop",
    "older": "written by an older koop; left alone: make it again by the same command",
}


@dataclass(frozen=True)
class Finding:
    """Something that is not as the store would have it; of the kinds in ``DAMAGE`` something committed is lost.

    ``path`` is relative to the store; ``artefact`` is the full name of the one concerned, where there is one.
    """

    kind: str
    path: str
    what: str
    artefact: str = ""
    repaired: bool = False

    @property
    def name(self) -> str:
        """The artefact's name, as commands print it."""
        return short_name(self.artefact) if self.artefact else ""

    @property
    def damage(self) -> bool:
        """Whether something committed is lost."""
        return self.kind in DAMAGE


@dataclass(frozen=True)
class Report:
    """What was found among ``checked`` artefacts, of whose objects ``read`` bytes were read.

    ``other_format`` more have a format that this koop does not read.
    """

    checked: int
    other_format: int
    read: int
    unfinished: int
    quarantine: int
    findings: tuple[Finding, ...]


Opens = Callable[[Record, Packed], tuple[str, str] | None]
"""Whether the content of a record, whose bytes are right, unpacks: None, or a kind of finding and why not."""


def verify(store: Store, opens: Opens | None, progress: Progress = silent) -> Report:
    """Check every record, and every object against it; with ``opens`` every byte of the objects too."""
    stock = survey(store.root)
    objects = _Objects(store, stock, opens, progress)
    findings = [*_records(store, stock), *objects.check(), *_pins(store, stock), *_beside(store, stock)]
    other_format = sum(bool(recorded.format) for recorded in stock.records.values())
    return Report(
        checked=len(stock.records) - other_format,
        other_format=other_format,
        read=objects.read,
        unfinished=len(stock.chunks),
        quarantine=len(stock.quarantine),
        findings=tuple(findings),
    )


def _records(store: Store, stock: Stock) -> Iterator[Finding]:
    for full, recorded in stock.records.items():
        path = _relative(store, recorded.file.path)
        if recorded.record is None and recorded.damaged:
            yield Finding("damaged record", path, "does not match its own check or its name", full)
        elif recorded.record is None:
            yield Finding(f"{recorded.format} format", path, OTHER_FORMAT[recorded.format], full)
        else:
            for role, name in recorded.record.lineage.items():
                if name not in stock.records:
                    yield Finding("input gone", path, f"its {role}, {short_name(name)}, is no longer here", full)
    for full, recorded in stock.lost.items():
        remedy = (
            "is whole: --repair makes it again" if recorded.recipe is not None else "is lost: run its command afresh"
        )
        what = f"it was damaged, its recipe {remedy}; remove the file to give the artefact up"
        artefact = full if recorded.stage else ""
        yield Finding("record put aside", _relative(store, recorded.file.path), what, artefact)


@dataclass
class _Objects:
    store: Store
    stock: Stock
    opens: Opens | None
    progress: Progress
    read: int = 0
    _kept: set[str] = field(default_factory=set)
    """What records in quarantine name; gc keeps it."""

    def check(self) -> Iterator[Finding]:
        """Findings about the objects, missing ones included."""
        users = self.stock.named_by()
        self._kept = {digest for lost in self.stock.lost.values() for digest in lost.named()}
        total = max(1, sum(file.size for file in self.stock.objects.values()))
        done = 0
        for digest in sorted(users.keys() | self.stock.objects):
            file = self.stock.objects.get(digest)
            yield from self._check(digest, users.get(digest, []))
            done += file.size if file else 0
            self.progress(done, total)

    def _check(self, digest: str, users: list[Recorded]) -> Iterator[Finding]:
        path = object_path(self.store.root, digest)
        shown = _relative(self.store, path)
        for user in users:
            beside = self._digests(user, path)
            if beside is not None:
                yield Finding(beside[0], _relative(self.store, digests.slabs_path(path)), beside[1], user.full)
            look = self._used if beside is None else self._hashed
            problem = self._problem(partial(look, user), user.file.path.exists)
            if problem is not None:
                yield Finding(problem[0], shown, problem[1], user.full)
        if not users:
            problem = self._problem(lambda: self._unused(path, digest), lambda: False)
            orphan = self.stock.all_read() and digest not in self._kept
            if problem is not None and (problem[0] != ORPHAN or orphan):
                yield Finding(problem[0], shown, problem[1])

    def _digests(self, recorded: Recorded, path: Path) -> tuple[str, str] | None:
        """What is wrong with the digests of the slabs of an object that is there."""
        assert recorded.record is not None, "it names an object"
        name, size = recorded.record.object, recorded.record.size
        if size <= digests.WHOLE or not path.exists():
            return None
        problem = self._problem(
            partial(self._beside, path, name, size), lambda: recorded.file.path.exists() and path.exists()
        )
        if problem is None:
            return None
        kind, what = problem
        if kind == "missing object":
            what = "the digests of its slabs are gone, its data are there: --repair writes them again"
        return kind.replace("object", "digests"), what

    def _beside(self, path: Path, name: str, size: int) -> tuple[str, str] | None:
        if self.opens is not None:
            digests.read_digests(path, name, size)
            return None
        with open_regular(digests.slabs_path(path)) as (_, length):
            wanted = digests.digests_size(size)
            return None if length == wanted else ("damaged object", f"has {length:,} bytes, not {wanted:,}")

    def _problem(
        self, look: Callable[[], tuple[str, str] | None], expected: Callable[[], bool]
    ) -> tuple[str, str] | None:
        """What ``look`` finds or meets; a missing file is none where it is no longer ``expected``."""
        try:
            return look()
        except FileNotFoundError:
            return ("missing object", "its record is there, its data are not") if expected() else None
        except PermissionError:
            return "unreadable object", "permission denied: mend its permissions"
        except UntrustedFileError as error:
            return "damaged object", str(error)
        except OSError as error:
            return "damaged object", f"cannot be read: {error.strerror or error}"

    def _used(self, recorded: Recorded) -> tuple[str, str] | None:
        assert recorded.record is not None, "it names an object"
        if self.opens is None:
            return self._hashed(recorded)
        self.read += recorded.record.size
        return self.opens(recorded.record, self.store.inspect(recorded.record))

    def _hashed(self, recorded: Recorded) -> tuple[str, str] | None:
        """Whether an object has its size and, unless the check is a fast one, bytes that match its name."""
        assert recorded.record is not None, "it names an object"
        with open_regular(self.store.path(recorded.record)) as (file, size):
            if size != recorded.record.size:
                return "damaged object", f"has {size:,} bytes, not {recorded.record.size:,}"
            if self.opens is not None:
                self.read += size
                if digests.named(file)[0] != recorded.record.object:
                    return "damaged object", digests.WRONG
        return None

    def _unused(self, path: Path, digest: str) -> tuple[str, str]:
        with open_regular(path) as (file, size):
            if self.opens is not None:
                self.read += size
                if digests.named(file)[0] != digest:
                    return "damaged object", "its bytes do not match its name; no record names it"
        return (
            ORPHAN,
            f"{size_text(size)} that no record names: koop gc removes it; after a copy that was cut off, copy again",
        )


def _pins(store: Store, stock: Stock) -> Iterator[Finding]:
    for label, names in stock.pins.items():
        path = f"refs/{label}.json"
        if names is None:
            yield Finding("damaged pin", path, f"does not say what it keeps: koop unpin {label}, and pin again")
        for name in names or []:
            if name not in stock.records:
                what = f"keeps {short_name(name)}, which is gone: make it again, or koop unpin {label}"
                yield Finding("pin of nothing", path, what, name)


def _beside(store: Store, stock: Stock) -> Iterator[Finding]:
    """What is no artefact: litter, chunks of what is finished, and what nobody here has written."""
    users = stock.named_by()
    finished = {user.key: user.full for digest in users.keys() & stock.objects.keys() for user in users[digest]}
    for key, files in stock.chunks.items():
        if key in finished:
            what = f"{len(files)} chunks of a finished artefact: the next command clears them"
            yield Finding("orphan chunks", f"partial/{key}", what, finished[key])
    lone = stock.slabs.keys() - stock.objects.keys() - users.keys() if stock.all_read() else ()
    for digest in sorted(lone):
        path = _relative(store, stock.slabs[digest].path)
        yield Finding(ORPHAN, path, "the digests of an object that is not here: see koop gc")
    for _, file in stock.removing:
        yield Finding("half-removed object", _relative(store, file.path), "a `koop gc` was cut off here: run it again")
    now = max(time.time(), stock.newest())  # only to tell a file at work from litter
    for file in stock.temporary:
        if now - file.mtime > HOUR:
            yield Finding("temporary file", _relative(store, file.path), "left by a process that was cut off")
    for file in stock.foreign:
        yield Finding("foreign file", _relative(store, file.path), "not written by koop; left alone")


def _relative(store: Store, path: Path) -> str:
    return path.relative_to(store.root).as_posix()
