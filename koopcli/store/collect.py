"""Find and remove what nobody keeps. No lock: whoever commits or reads at the same time loses nothing committed.

A record is removed before its object, and an object is moved away, looked for in the records once more, and put back
if one names it; :meth:`Store.commit` looks after its object once more when its record is there. Whichever of the two
comes last finds the other's work.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

from koopcli.errors import DamagedArtefactError, StorageError
from koopcli.progress import Progress, silent
from koopcli.store.digests import slabs_path
from koopcli.store.files import DAY, HOUR, make_folder, own_name, storage_errors
from koopcli.store.locks import if_free
from koopcli.store.store import Store
from koopcli.store.survey import PUT_ASIDE, File, Recorded, Stock, look, object_path, pinned, records, survey
from koopcli.text import printable


@dataclass(frozen=True)
class Removal:
    """Something that nobody keeps: ``name`` of an artefact, else a path; ``size`` is what removing it frees.

    ``files`` are removed one after another; ``objects`` are removed after all records.
    """

    kind: str
    name: str
    size: int
    files: tuple[File, ...]
    objects: tuple[str, ...] = ()
    key: str = ""


@dataclass(frozen=True)
class CollectionPlan:
    """What a collection removes; ``kept`` artefacts stay. ``clock`` says how the age of files was measured."""

    removals: tuple[Removal, ...]
    kept: int
    there: Stock = field(repr=False)
    clock: str = ""

    @property
    def size(self) -> int:
        """Bytes that are freed."""
        return sum(removal.size for removal in self.removals)


def plan(store: Store, grace: float, *, delete: bool = False, progress: Progress = silent) -> CollectionPlan:
    """What is neither pinned nor younger than ``grace`` seconds, nor was used to make any such thing.

    Raises ``DamagedArtefactError`` for a damaged pin, as nobody knows what it keeps.
    """
    stock = survey(store.root, progress)
    damaged = [printable(label) for label, names in stock.pins.items() if names is None]
    if damaged:
        raise DamagedArtefactError(
            f"the pin {damaged[0]} is damaged and what it keeps unknown, so nothing is removed: "
            f"koop unpin {damaged[0]}, and pin again what is to stay"
        )
    if not any((stock.objects, stock.slabs, stock.removing, stock.records, stock.chunks, stock.locks, stock.temporary)):
        return CollectionPlan((), 0, stock)
    now, clock = _clock(store, stock, delete)
    kept = _kept(stock, now - grace)
    removals = [
        *_artefacts(store, stock, kept, now - max(grace, HOUR)),
        *_unfinished(store, stock, now - grace),
        *(
            Removal("temporary file", _relative(store, file), file.size, (file,))
            for file in stock.temporary
            if now - file.mtime > DAY
        ),
        *(
            Removal("lock", _relative(store, file), file.size, (file,))
            for file in stock.locks
            if now - file.mtime >= max(grace, HOUR) and _free(file.path)
        ),
    ]
    return CollectionPlan(tuple(removals), len(kept & stock.records.keys()), stock, clock)


def remove(store: Store, planned: CollectionPlan, progress: Progress = silent) -> list[Removal]:
    """Remove what was planned, but for what is wanted or in use meanwhile; returns what was removed."""
    done: list[Removal] = []
    waiting: list[Removal] = []
    with storage_errors(store.root):
        _put_back(store, planned.there)
        for i, removal in enumerate(planned.removals):
            progress(i, len(planned.removals))
            if removal.kind == "orphan object":
                waiting.append(removal)
            elif removal.kind == "artefact":
                if _remove_record(store, removal, planned.there):
                    waiting.append(removal)
            elif _remove_files(store, removal):
                done.append(removal)
        left = _remove_objects(store, {digest for removal in waiting for digest in removal.objects}, planned.there)
    for removal in waiting:
        if not left & set(removal.objects):
            done.append(removal)
        elif removal.kind == "artefact":  # somebody has committed equal data
            done.append(replace(removal, size=removal.files[0].size))
    return done


def _kept(stock: Stock, before: float) -> set[str]:
    """Full names of what is pinned or young, and of all that it was made from. What does not read here is kept.

    What was made again is as young as its object, whatever the age of its record.
    """
    waiting = [*stock.lost, *(name for names in stock.pins.values() for name in names or [])]
    for full, recorded in stock.records.items():
        file = stock.objects.get(recorded.record.object) if recorded.record is not None else None
        if recorded.record is None or max(recorded.file.mtime, file.mtime if file else 0.0) > before:
            waiting.append(full)
    return _closure(stock, waiting)


def _closure(stock: Stock, waiting: Sequence[str]) -> set[str]:
    records = _recorded(stock)
    by_key = {recorded.key: full for full, recorded in records.items()}
    by_data: dict[str, list[str]] = {}
    for full, any_record in records.items():
        if any_record.record is not None:
            by_data.setdefault(any_record.record.data, []).append(full)
    closure: set[str] = set()
    left = list(waiting)
    while left:
        recorded = records.get(left.pop())
        if recorded is not None and recorded.full not in closure:
            closure.add(recorded.full)
            if recorded.record is not None:
                left += recorded.record.lineage.values()
            else:
                left += [by_key[key] for key in recorded.named() if key in by_key]
                if recorded.recipe is not None:  # cut off behind it, a record names its inputs in it alone
                    left += [full for data in recorded.recipe["inputs"].values() for full in by_data.get(data, [])]
    return closure


def _recorded(stock: Stock) -> dict[str, Recorded]:
    """Every record, also those that were put aside; of two of one name, one whose recipe is whole."""
    records = {**stock.lost, **stock.records}
    return records | {full: lost for full, lost in stock.lost.items() if records[full].recipe is None}


def _artefacts(store: Store, stock: Stock, kept: set[str], before: float) -> Iterator[Removal]:
    """Records that nobody keeps, each with its object once no other record names it; then objects without any."""
    recorded_by_name = _recorded(stock)
    wanted = {digest for full in kept for digest in recorded_by_name[full].named()}
    freed: set[str] = set()
    for full in sorted(stock.records.keys() - kept):
        recorded = stock.records[full]
        if recorded.record is None:
            continue
        digest = recorded.record.object
        file = stock.objects.get(digest) if digest not in wanted | freed else None
        size = recorded.file.size + (file.size if file else 0)
        freed |= {digest} if file else set()
        yield Removal("artefact", recorded.record.name, size, (recorded.file,), (digest,) if file else (), full)
    if not stock.all_read():
        return
    used = wanted | stock.named_by().keys()
    for digest, file in {**stock.slabs, **stock.objects}.items():
        if digest not in used and file.mtime < before:
            yield Removal("orphan object", _relative(store, file), file.size, (file,), (digest,))


def _unfinished(store: Store, stock: Stock, before: float) -> Iterator[Removal]:
    """Chunks of what nobody has gone on with."""
    for key, files in stock.chunks.items():
        if all(file.mtime <= before for file in files) and _free(store.root / "locks" / f"{key}.lock"):
            yield Removal("chunks", f"partial/{key}", sum(file.size for file in files), tuple(files), key=key)


def _clock(store: Store, stock: Stock, delete: bool) -> tuple[float, str]:
    """Now, by the file system that gave the files their times, and how it was found where not in the usual way."""
    temporary = store.root / "tmp"
    probe = temporary / own_name()
    try:
        with storage_errors(temporary):
            make_folder(temporary)
            try:
                os.close(os.open(probe, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
                return probe.stat().st_mtime, ""
            finally:
                probe.unlink(missing_ok=True)
    except StorageError:
        if delete:
            raise
        return stock.newest(), "the store is read-only: ages are counted from the newest file in it"


def _remove_record(store: Store, removal: Removal, stock: Stock) -> bool:
    """Remove the record of an artefact, unless it was pinned, made again or used meanwhile."""
    pins = pinned(store.root)
    (file,) = removal.files
    stage, _, key = removal.key.partition("/")
    now = look(file.path, stage, key)
    if now is None or now.file != file or any(names is None for names in pins.values()):
        return False
    if now.record is not None and not _untouched(store, now.record.object, stock):
        return False
    wanted = [name for names in pins.values() for name in names or []]
    if removal.key in _closure(stock, wanted):
        return False
    _give_up(store, key)
    try:
        file.path.unlink()
    except FileNotFoundError:
        return False
    return True


def _give_up(store: Store, key: str) -> None:
    """Rename what was put aside of an artefact, so that nobody takes that for lost which is now removed."""
    for path in (store.root / "quarantine").glob(f"{key}.json*"):
        if PUT_ASIDE.fullmatch(path.name):
            os.replace(path, path.with_name(f"{path.name}.{own_name()}"))


def _remove_files(store: Store, removal: Removal) -> bool:
    """Remove litter, while nobody holds the lock that it is or belongs to."""
    if removal.kind == "temporary file":
        removal.files[0].path.unlink(missing_ok=True)
        return True
    lock = removal.files[0].path
    if removal.kind == "chunks":
        lock = store.root / "locks" / f"{removal.key}.lock"
        make_folder(lock.parent)
        lock.touch()  # so that it can be held
    with if_free(lock) as free:
        if free:
            for file in removal.files:
                file.path.unlink(missing_ok=True)
            lock.unlink(missing_ok=True)
    if removal.kind == "chunks" and free:
        with suppress(OSError):  # somebody has gone on with it
            removal.files[0].path.parent.rmdir()
    return free


def _remove_objects(store: Store, digests: set[str], stock: Stock) -> set[str]:
    """Remove objects that no record names; returns those that are still there."""
    away: list[tuple[str, Path]] = []
    suffix = own_name()
    for digest in sorted(digests):
        if _untouched(store, digest, stock):
            path = object_path(store.root, digest)
            for file in (path, slabs_path(path)):
                with suppress(FileNotFoundError):
                    aside = file.with_name(f"{file.name}.{suffix}")
                    os.replace(file, aside)
                    away.append((digest, aside))
    _settle(store, away)
    return {digest for digest in digests if object_path(store.root, digest).exists()}


def _untouched(store: Store, digest: str, stock: Stock) -> bool:
    """Whether an object is as it was when it was looked at; one that somebody has put again is young."""
    try:
        about = object_path(store.root, digest).lstat()
    except FileNotFoundError:
        return digest not in stock.objects
    then = stock.objects.get(digest)
    return then is not None and (about.st_size, about.st_mtime) == (then.size, then.mtime)


def _settle(store: Store, away: Sequence[tuple[str, Path]]) -> None:
    """Put files of objects that were moved away back where a record names them, and remove the others."""
    if not away:
        return
    named = {digest for recorded in records(store.root).values() for digest in recorded.named()}
    for digest, aside in away:
        with suppress(FileNotFoundError):
            if digest in named:
                os.replace(aside, aside.with_name(".".join(aside.name.split(".")[:2])))
            else:
                aside.unlink()


def _put_back(store: Store, stock: Stock) -> None:
    """End what a collection that was cut off had begun; one that is still at work meets nothing it does not expect."""
    for digest, file in stock.removing:
        _settle(store, [(digest, file.path)])


def _free(lock: Path) -> bool:
    with if_free(lock) as free:
        return free


def _relative(store: Store, file: File) -> str:
    return file.path.relative_to(store.root).as_posix()
