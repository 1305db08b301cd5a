"""What lies in a store, looked at without touching it: nothing is moved, written or locked."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from koopcli.errors import NewerFormatError, OlderFormatError
from koopcli.parsing import parse_json
from koopcli.progress import Progress, silent
from koopcli.store.files import UntrustedFileError, read_small, reading_errors
from koopcli.store.names import STAGE, is_name
from koopcli.store.parts import CHUNK
from koopcli.store.records import BadRecordError, Record, whole_recipe

DIGEST = "[0-9a-f]{64}"
WRITER = r"\d+-[0-9a-f]{16}@.+"  # the process that writes or removes a file
RECORD = re.compile(rf"({DIGEST})\.json")
OBJECT = re.compile(rf"({DIGEST})\.h5")
PUT_ASIDE = re.compile(rf"({DIGEST})\.json(\.\d+)?")
NAMES = re.compile(rf"(?<![0-9a-f]){DIGEST}(?![0-9a-f])".encode())
STAGE_NAMED = re.compile(rb'"stage"\s*:\s*"([a-z0-9-]{1,64})"')
SLABS = re.compile(rf"({DIGEST})\.slabs")
REMOVING = re.compile(rf"({DIGEST})\.(?:h5|slabs)\.{WRITER}")
FOLDERS = ("objects", "records", "partial", "refs", "locks", "tmp", "quarantine", "reports")
BESIDE = ("README.md", ".gitignore")  # what a checkout keeps in its store


@dataclass(frozen=True)
class File:
    """A file as it was when it was looked at."""

    path: Path
    size: int
    mtime: float


@dataclass(frozen=True)
class Recorded:
    """A file among the records: its ``record``, or the ``text`` of one that is ``damaged`` or of another ``format``."""

    file: File
    stage: str
    key: str
    record: Record | None
    damaged: bool = False
    text: bytes = b""
    format: Literal["", "newer", "older"] = ""
    """Which format it has, where this koop does not read it."""
    recipe: dict[str, Any] | None = None
    """Of a damaged record: its recipe, if that is whole."""

    @property
    def full(self) -> str:
        """The artefact's full name, or its key where the stage is unknown."""
        return f"{self.stage}/{self.key}" if self.stage else self.key

    def named(self) -> set[str]:
        """The object that the record names; of one that does not read here, every digest and key in its text."""
        if self.record is not None:
            return {self.record.object}
        return {text.decode() for text in NAMES.findall(self.text)}


@dataclass
class Stock:
    """Every file of a store by what it is, as its name says."""

    objects: dict[str, File] = field(default_factory=dict)
    slabs: dict[str, File] = field(default_factory=dict)
    """The digests of the slabs of large objects, by the object's name."""
    removing: list[tuple[str, File]] = field(default_factory=list)
    records: dict[str, Recorded] = field(default_factory=dict)
    chunks: dict[str, list[File]] = field(default_factory=dict)
    pins: dict[str, list[str] | None] = field(default_factory=dict)
    """label -> full names, or None for one that does not read"""
    locks: list[File] = field(default_factory=list)
    temporary: list[File] = field(default_factory=list)
    quarantine: list[File] = field(default_factory=list)
    lost: dict[str, Recorded] = field(default_factory=dict)
    """Damaged records in quarantine as long as no good record has their key, by name, or key where that is unknown."""
    foreign: list[File] = field(default_factory=list)

    def named_by(self) -> dict[str, list[Recorded]]:
        """digest -> the readable records that name this object."""
        users: dict[str, list[Recorded]] = {}
        for recorded in self.records.values():
            if recorded.record is not None:
                users.setdefault(recorded.record.object, []).append(recorded)
        return users

    def all_read(self) -> bool:
        """Whether every record reads here. Otherwise what looks like an orphan may belong to one that does not."""
        return all(recorded.record is not None for recorded in self.records.values())

    def newest(self) -> float:
        """The latest time of any object or record, 0 in an empty store."""
        files = [*self.objects.values(), *(recorded.file for recorded in self.records.values())]
        return max((file.mtime for file in files), default=0.0)


def survey(root: Path, progress: Progress = silent) -> Stock:
    """Everything in the store at ``root``. Objects come before records: what is committed meanwhile is not missed."""
    stock = Stock()
    with reading_errors(root):
        for entry in _entries(root, top=True):
            if entry.name not in BESIDE and not (entry.name in FOLDERS and entry.is_dir(follow_symlinks=False)):
                _add(stock.foreign, entry)
        _objects(root, stock)
        stock.records = records(root, stock.foreign, progress)
        for entry in _entries(root / "partial"):
            inner = list(_entries(Path(entry.path))) if re.fullmatch(DIGEST, entry.name) else [entry]
            for file in inner:
                fits = file is not entry and CHUNK.fullmatch(file.name)
                _add(stock.chunks.setdefault(entry.name, []) if fits else stock.foreign, file)
        stock.pins = pinned(root, stock.foreign)
        for name, files, pattern in (
            ("locks", stock.locks, rf"{DIGEST}\.lock"),
            ("tmp", stock.temporary, WRITER),
            ("quarantine", stock.quarantine, ".*"),
        ):
            for entry in _entries(root / name):
                _add(files if re.fullmatch(pattern, entry.name, re.S) else stock.foreign, entry)
        stock.lost = _lost(stock)
    return stock


def records(root: Path, foreign: list[File] | None = None, progress: Progress = silent) -> dict[str, Recorded]:
    """full name -> the file of a record; what is none goes to ``foreign``."""
    by_name: dict[str, Recorded] = {}
    strange: list[File] = [] if foreign is None else foreign
    stages = list(_entries(root / "records"))
    for i, stage in enumerate(stages):
        if not STAGE.fullmatch(stage.name) or not stage.is_dir(follow_symlinks=False):
            _add(strange, stage)
            continue
        entries = list(_entries(Path(stage.path)))
        for j, entry in enumerate(entries):
            progress(int(1000 * (i + j / len(entries))), 1000 * len(stages))
            match = RECORD.fullmatch(entry.name)
            if not match or entry.is_dir():
                _add(strange, entry)
            elif (recorded := look(Path(entry.path), stage.name, match[1])) is not None:
                by_name[recorded.full] = recorded
    return by_name


def object_path(root: Path, digest: str) -> Path:
    """Where the object ``digest`` lies, if it does."""
    return root / "objects" / digest[:2] / f"{digest}.h5"


def look(path: Path, stage: str, key: str) -> Recorded | None:
    """The record at ``path`` as it stands, None when it is gone."""
    try:
        about = path.lstat()
        text = read_small(path)
    except FileNotFoundError:
        return None
    except UntrustedFileError:
        return Recorded(File(path, about.st_size, about.st_mtime), stage, key, None, True)
    file = File(path, about.st_size, about.st_mtime)
    try:
        return Recorded(file, stage, key, Record.from_json(text, stage, key))
    except BadRecordError:
        return Recorded(file, stage, key, None, True, text, recipe=whole_recipe(text, key))
    except NewerFormatError as error:
        return Recorded(
            file, stage, key, None, False, text, "older" if isinstance(error, OlderFormatError) else "newer"
        )


def _lost(stock: Stock) -> dict[str, Recorded]:
    """The damaged records in quarantine whose key no good record has; of several, one whose recipe is whole."""
    good = {recorded.key for recorded in stock.records.values() if not recorded.damaged}
    by_key: dict[str, Recorded] = {}
    for file in stock.quarantine:
        match = PUT_ASIDE.fullmatch(file.path.name)
        if match is not None and match[1] not in good:
            recorded = _put_aside(file, match[1])
            if recorded.recipe is not None or match[1] not in by_key:
                by_key[match[1]] = recorded
    return {recorded.full: recorded for recorded in by_key.values()}


def _put_aside(file: File, key: str) -> Recorded:
    """The damaged record of ``key`` that a file in quarantine is; its stage without a recipe is as its text has it."""
    try:
        text = read_small(file.path)
    except (OSError, UntrustedFileError):
        text = b""
    recipe = whole_recipe(text, key)
    stage = STAGE_NAMED.search(text)
    name = recipe["stage"] if recipe is not None else stage[1].decode() if stage else ""
    if not is_name(f"{name}/{key}"):
        return Recorded(file, "", key, None, True, text)
    return Recorded(file, name, key, None, True, text, recipe=recipe)


def pinned(root: Path, foreign: list[File] | None = None) -> dict[str, list[str] | None]:
    """label -> the full names that a pin keeps, None for a pin that does not read."""
    pins: dict[str, list[str] | None] = {}
    for entry in _entries(root / "refs"):
        if not entry.name.endswith(".json"):
            _add([] if foreign is None else foreign, entry)
            continue
        pins[entry.name.removesuffix(".json")] = _pin(Path(entry.path))
    return pins


def _pin(path: Path) -> list[str] | None:
    try:
        names = parse_json(read_small(path))["names"]
        return names if isinstance(names, list) and all(map(is_name, names)) else None
    except (OSError, UntrustedFileError, ValueError, KeyError, TypeError):
        return None


def _objects(root: Path, stock: Stock) -> None:
    for folder in _entries(root / "objects"):
        if not folder.is_dir(follow_symlinks=False):
            _add(stock.foreign, folder)
            continue
        for entry in _entries(Path(folder.path)):
            match, leaving = OBJECT.fullmatch(entry.name), REMOVING.fullmatch(entry.name)
            slabs = SLABS.fullmatch(entry.name)
            files: list[File] = []
            if entry.is_dir() or not entry.name.startswith(folder.name) or not (match or slabs or leaving):
                _add(stock.foreign, entry)
            elif _add(files, entry):
                if match:
                    stock.objects[match[1]] = files[0]
                elif slabs:
                    stock.slabs[slabs[1]] = files[0]
                elif leaving:
                    stock.removing.append((leaving[1], files[0]))


def _add(files: list[File], entry: os.DirEntry[str]) -> bool:
    """Add what ``entry`` is now, unless it has gone meanwhile."""
    try:
        about = entry.stat(follow_symlinks=False)
    except FileNotFoundError:
        return False
    files.append(File(Path(entry.path), about.st_size, about.st_mtime))
    return True


def _entries(folder: Path, top: bool = False) -> Iterator[os.DirEntry[str]]:
    """What is in ``folder``, by name; nothing where there is no such folder, or a link in its place."""
    try:
        with os.scandir(folder) as entries:
            ordered = sorted(entries, key=lambda entry: entry.name)
    except (FileNotFoundError, NotADirectoryError):
        return
    yield from (entry for entry in ordered if top or not folder.is_symlink())
