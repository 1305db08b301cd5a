"""Which files of a log are sources of a map, and which are other runs of one of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from pathlib import Path

from koopcli.errors import InvalidValueError
from koopcli.logs.clockclues import TIMES
from koopcli.logs.clues import FileClues, look_at
from koopcli.text import one_line

NO_LOGS = frozenset((".md", ".toml", ".json", ".yaml", ".yml", ".png", ".jpg", ".pdf", ".py", ".m"))


def sources_of(files: Sequence[Path], notes: list[str]) -> list[FileClues]:
    """The clues of each file that is no other run of one before, and no time of another.

    A file that shares its columns with others of other names is a source with a pattern of their names as its ending.
    """
    folders: dict[Path, int] = {}
    for path in files:
        folders[path.parent] = folders.get(path.parent, 0) + 1
    sources: dict[str, FileClues] = {}
    runs: dict[str, int] = {}
    alike: dict[str, list[Path]] = {}
    for path in files:
        if path.suffix.lower() in NO_LOGS or path.stem.lower() in ("license", "readme"):
            continue
        if path.stem.lower() in TIMES and folders[path.parent] > 1:
            continue
        try:
            clues = look_at(path, files)
        except InvalidValueError as error:
            notes.append(one_line(str(error)))
            continue
        if clues.ending in (file.ending for file in sources.values()):
            runs[clues.ending] = runs.get(clues.ending, 1) + 1
            continue
        same = next((name for name, file in sources.items() if _same_columns(file, clues)), None)
        if same is not None:
            alike.setdefault(same, [sources[same].path]).append(path)
            continue
        name, count = clues.source, 2
        while name in sources:
            name, count = f"{clues.source}_{count}", count + 1
        sources[name] = clues if name == clues.source else _renamed(clues, name)
    notes += [f"{ending} is there {count} times: each is taken for a run" for ending, count in runs.items()]
    for name, paths in alike.items():
        sources[name] = _with_pattern(sources[name], paths, files, notes)
    return list(sources.values())


def _same_columns(file: FileClues, other: FileClues) -> bool:
    """Whether two files are recordings of the same signals: all columns have the same names, and some are known."""
    names = file.table.names
    known = any(clue.title in names for clue in file.clues)
    return known and names == other.table.names and file.path.suffix == other.path.suffix


def _with_pattern(file: FileClues, paths: Sequence[Path], files: Sequence[Path], notes: list[str]) -> FileClues:
    """The source of a file and of others with the same columns, by the pattern that matches their names alone."""
    names = [path.name for path in paths]
    others = {path.name for path in files} - set(names)
    suffix = paths[0].suffix
    begin, end = _common(names), _common([name[::-1] for name in names])[::-1]
    patterns = (f"*{suffix}", f"{begin}*{suffix}", f"*{end}")
    escaped = [pattern.replace("[", "[[]") for pattern in patterns]
    for pattern in escaped:
        if all(fnmatchcase(name, pattern) for name in names) and not any(fnmatchcase(o, pattern) for o in others):
            notes.append(f"{len(names)} files have the columns of {file.ending}: each is taken for a run, '{pattern}'")
            return replace(file, ending=pattern)
    shown = ", ".join(names[1:4])
    notes.append(f"{shown} have the columns of {file.ending}: they are not in the map, say a pattern as its file")
    return file


def _common(names: Sequence[str]) -> str:
    """What all names begin with."""
    first, last = min(names), max(names)
    same = next((i for i, (a, b) in enumerate(zip(first, last, strict=False)) if a != b), min(len(first), len(last)))
    return first[:same]


def _renamed(clues: FileClues, name: str) -> FileClues:
    return replace(clues, source=name, clues=[replace(clue, source=name) for clue in clues.clues])
