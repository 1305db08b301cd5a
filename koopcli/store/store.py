"""The store: objects by digest, records by key. The record is the commit point.

objects/ab/<sha256>.h5, of large ones <sha256>.slabs beside it   records/<stage>/<key>.json
partial/<key>/<i>-<sha256>-<code>.h5   refs/ (pins)   locks/   tmp/   quarantine/
"""

from __future__ import annotations

import hashlib
import io
import os
import stat
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, suppress
from functools import partial
from itertools import count
from pathlib import Path
from types import MappingProxyType
from typing import IO, Any, NoReturn

from koopcli.errors import (
    DamagedArtefactError,
    StorageError,
    UnknownNameError,
)
from koopcli.paths import is_folder
from koopcli.records import Packed
from koopcli.store import digests, image
from koopcli.store.files import (
    Published,
    UntrustedFileError,
    make_folder,
    open_regular,
    publish,
    read_small,
    reading_errors,
    refuse_on_full_disk,
    storage_errors,
    sweep,
    sync_young,
)
from koopcli.store.identity import data_digest
from koopcli.store.locks import hold
from koopcli.store.names import SHORT, index, is_name
from koopcli.store.parts import Parts
from koopcli.store.records import BadRecordError, Record

CANDIDATES = 8
NOTHING: Mapping[str, Any] = MappingProxyType({})
AGAIN = 3  # times to read a file that others replace meanwhile, before it is taken for damaged


class Store:
    """A folder of artefacts. Reading takes no lock and writes nothing; ``warn`` receives what a user should know."""

    def __init__(self, root: Path, warn: Callable[[str], None] = lambda text: None) -> None:
        self.root = root
        self.warn = warn
        self._swept = False
        with reading_errors(root):
            if not is_folder(root) and os.path.lexists(root):
                raise StorageError(f"the store {root} is not a folder, or a link to none: choose another with --store")

    # reading

    def record(self, stage: str, key: str) -> Record | None:
        """The record of ``key``, or None; a damaged one is put aside."""
        if not is_name(f"{stage}/{key}"):
            return None
        path = self._record_path(stage, key)
        for _ in range(AGAIN):
            before = _identity(path)
            try:
                with reading_errors(path):
                    return Record.from_json(read_small(path), stage, key)
            except FileNotFoundError:
                return None
            except (BadRecordError, UntrustedFileError):
                if _identity(path) == before:
                    break
        self.warn(f"the record of {stage}/{key[:SHORT]} is damaged {self._put_aside(path)}")
        return None

    def index(self) -> list[tuple[str, str]]:
        """(stage, key) of every record, by stage."""
        with reading_errors(self.root):
            return index(self.root)

    def find(self, text: str) -> Record:
        """The record whose name or key starts with ``text``.

        Raises ``UnknownNameError`` for none or several, also where no name is given, and ``DamagedArtefactError``
        when its record does not read.
        """
        if not text.strip():
            raise UnknownNameError(
                f"the name '{text}' is empty, as a failed command leaves it: name an artefact, `koop ls` lists them"
            )
        pairs = [(stage, key) for stage, key in self.index() if is_name(f"{stage}/{key}")]
        matches = [(s, k) for s, k in pairs if f"{s}/{k}".startswith(text) or k.startswith(text)]
        if len(matches) > 1:
            names = ", ".join(f"{stage}/{key[:SHORT]}" for stage, key in matches[:CANDIDATES])
            more = f" and {len(matches) - CANDIDATES} more" if len(matches) > CANDIDATES else ""
            raise UnknownNameError(f"'{text}' is ambiguous: {names}{more}")
        if not matches:
            raise UnknownNameError(f"there is no artefact '{text}' in {self.root}: `koop ls` lists what there is")
        record = self.record(*matches[0])
        if record is None:
            raise DamagedArtefactError(f"the record of '{text}' is damaged, its recipe unknown: run its command afresh")
        return record

    def path(self, record: Record) -> Path:
        """Where the object of ``record`` lies."""
        return self._object_path(record.object)

    def has_object(self, record: Record) -> bool:
        """Whether the object is there, as a file and not a link; a record without its object is a miss."""
        path = self.path(record)
        files = [path] if record.size <= digests.WHOLE else [path, digests.slabs_path(path)]
        try:
            with reading_errors(self.root):
                return all(stat.S_ISREG(file.lstat().st_mode) for file in files)
        except FileNotFoundError:
            return False

    def read(self, record: Record) -> Packed:
        """The verified content. Raises ``DamagedArtefactError`` after putting a damaged object aside."""
        path = self.path(record)
        for _ in range(AGAIN):
            before = _identity(path)
            try:
                with reading_errors(path):
                    return _verified(path, record, self._lost)
            except FileNotFoundError as error:
                raise DamagedArtefactError(f"the object of {record.name} is missing") from error
            except UntrustedFileError as error:
                why = error
                if _identity(path) == before:
                    break
        raise DamagedArtefactError(f"the object of {record.name} is damaged {self._put_aside(path)}: {why}") from why

    # writing

    def commit(
        self,
        recipe: Mapping[str, Any],
        lineage: Mapping[str, str],
        packed: Packed,
        provenance: Mapping[str, Any],
        labels: image.Labels = image.NO_LABELS,
        settings: Mapping[str, Any] = NOTHING,
    ) -> Record:
        """Store ``packed`` under ``recipe``, with ``labels`` for other tools: the object first, the record last.
        ``settings``: all of them, at their defaults or not.

        Where locks do not hold, another process may have committed the same recipe meanwhile: the first record wins.
        """
        digest = data_digest(packed)
        path, size, _ = self._put(packed, self._target, labels)
        record = Record(recipe, lineage, path.stem, size, digest, provenance, dict(settings))
        first = self.record(record.stage, record.key)
        if first is not None and self.has_object(first):
            self.sync(first)
            return first
        with storage_errors(self.root):
            self._publish(self._record_path(record.stage, record.key), record.to_json())
        if not self.has_object(record):  # a collection took it for an orphan just before its record was there
            self._put(packed, self._target, labels)
        return record

    def folder(self) -> Path:
        """The absolute path of the store's folder, which is there from now on."""
        with storage_errors(self.root):
            make_folder(self.root)
        return self.root.absolute()

    def require(self, needed: float) -> None:
        """Raise ``StorageError`` where the disk has no room for ``needed`` bytes."""
        with storage_errors(self.root, needed):
            refuse_on_full_disk(self.root, needed)

    def lock(self, key: str, name: str) -> AbstractContextManager[None]:
        """Hold the lock of ``key`` for the time of a ``with``; see :func:`koopcli.store.locks.hold`."""
        return hold(self.root / "locks" / f"{key}.lock", name, self.warn)

    def parts(self, key: str) -> Parts:
        """The committed chunks of an unfinished artefact."""
        return Parts(self.root / "partial" / key, self._put)

    def _put(
        self, packed: Packed, target: Callable[[IO[bytes]], Path], labels: image.Labels = image.NO_LABELS
    ) -> Published:
        """Write the image of ``packed`` to where ``target`` says of its bytes, through memory unless it is large."""
        needed = image.data_bytes(packed)
        with storage_errors(self.root, needed):
            if needed <= image.IMAGE_LIMIT:
                content = image.to_bytes(packed, labels)
                return self._publish(target(io.BytesIO(content)), content)

            def target_of(path: Path) -> Path:
                with path.open("rb") as file:
                    return target(file)

            return self._publish(target_of, lambda path: image.to_file(packed, path, labels))

    def _target(self, file: IO[bytes]) -> Path:
        """Where the object with the bytes of a ``file`` belongs; the digests of a large one are there from now on."""
        name, slabs = digests.named(file)
        path = self._object_path(name)
        if slabs:
            publish(digests.slabs_path(path), slabs, self.root / "tmp")
        return path

    def _publish(self, target: Path | Callable[[Path], Path], fill: bytes | Callable[[Path], None]) -> Published:
        """Publish a file; the first time, clear old litter by the file system's own clock."""
        temporary = self.root / "tmp"
        final = publish(target, fill, temporary)
        if not self._swept:
            self._swept = True
            sweep(temporary, final.mtime)
            self._sweep_chunks()
        return final

    def _sweep_chunks(self) -> None:
        """Remove chunks whose artefact is finished, which a process killed right after its commit leaves behind."""
        for folder in (self.root / "partial").glob("*"):
            for path in (self.root / "records").glob(f"*/{folder.name}.json"):
                record = self.record(path.parent.name, folder.name)
                if record is not None and self.has_object(record):  # without its object it is being made again
                    self.parts(folder.name).clear()

    def sync(self, record: Record) -> None:
        """Make what another process has just committed last before it is named: that one may have been killed first."""
        path = self.path(record)
        slabs = [digests.slabs_path(path)] if record.size > digests.WHOLE else []
        sync_young(self._record_path(record.stage, record.key), *slabs, path)

    def inspect(self, record: Record) -> Packed:
        """The verified content, as :meth:`read` has it; a damaged object stays where it is.

        Raises ``UntrustedFileError`` for a damaged one and ``FileNotFoundError`` for a missing one.
        """
        return _verified(self.path(record), record, None)

    def _lost(self, record: Record, file: io.FileIO) -> NoReturn:
        """What is done when a large object turns out damaged while it is read."""
        about, path = os.fstat(file.fileno()), self.path(record)
        aside = self._put_aside(path) if _identity(path) == (about.st_dev, about.st_ino) else "no longer"
        raise DamagedArtefactError(f"the object of {record.name} is damaged {aside}: {digests.WRONG}")

    def restore_digests(self, digest: str) -> bool:
        """See that the digests of the slabs of a large object are there, by reading it; ``False`` if it is damaged too.

        Raises ``StorageError`` where they cannot be written.
        """
        path = self._object_path(digest)
        beside = digests.slabs_path(path)
        try:
            with open_regular(path) as (file, size):
                name, slabs = digests.named(file)
        except (OSError, UntrustedFileError):
            return False
        if name != digest or not slabs:
            return False
        with suppress(OSError, UntrustedFileError):
            if digests.read_digests(path, digest, size) == slabs:
                return True
        if os.path.lexists(beside):
            self.put_aside(beside)
        with storage_errors(self.root, len(slabs)):
            self._publish(beside, slabs)
        return True

    def put_aside(self, path: Path) -> None:
        """Move a damaged file to quarantine. Raises ``StorageError`` where that cannot be done."""
        done = self._put_aside(path)
        if os.path.lexists(path):
            raise StorageError(f"{path} is damaged {done}: make the store writable, or choose another with --store")

    def _object_path(self, digest: str) -> Path:
        return self.root / "objects" / digest[:2] / f"{digest}.h5"

    def _record_path(self, stage: str, key: str) -> Path:
        return self.root / "records" / stage / f"{key}.json"

    def _put_aside(self, path: Path) -> str:
        """Move a damaged file to quarantine beside any earlier one; says what was done."""
        quarantine = self.root / "quarantine"
        try:
            make_folder(quarantine)
            names = (f"{path.name}.{number}" if number else path.name for number in count())
            os.replace(path, next(quarantine / name for name in names if not os.path.lexists(quarantine / name)))
        except OSError:
            return "and cannot be put aside in a read-only store"
        return "and was put aside"


def _identity(path: Path) -> tuple[int, int] | None:
    """Which file lies at ``path``: one that is found damaged may have been put right by another process."""
    try:
        about = path.lstat()
    except OSError:
        return None
    return about.st_dev, about.st_ino


def _verified(path: Path, record: Record, lost: Callable[[Record, io.FileIO], NoReturn] | None) -> Packed:
    """The content of the one file that is opened, sized, hashed and walked. Raises ``UntrustedFileError``.

    What is not read at once of a large object is verified when it is read, and ``lost`` says what is done if it is
    wrong; without that, all of it is verified here.
    """
    with open_regular(path) as (file, size):
        if size != record.size:
            raise UntrustedFileError(digests.WRONG)
        if size <= digests.WHOLE:
            content = file.read()
            if hashlib.sha256(content).hexdigest() != record.object:
                raise UntrustedFileError(digests.WRONG)
            return image.from_bytes(content)
        large = digests.VerifiedFile(os.dup(file.fileno()), digests.read_digests(path, record.object, size), size)
    if lost is None:
        large.verify()
    packed = image.from_open(large)
    if lost is not None:
        large.refuse = partial(lost, record)
    return packed
