"""The files of a log: patterns and folders are expanded, and files are matched to the sources and runs of a map."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from glob import glob
from pathlib import Path, PurePath

from koopcli.errors import InvalidValueError
from koopcli.logs.entries import LogMap, Source

NO_DATA = {
    ".md",
    ".toml",
    ".yaml",
    ".yml",
    ".json",
    ".pdf",
    ".png",
    ".jpg",
    ".svg",
    ".py",
    ".m",
    ".html",
    ".rst",
    ".dbc",
}
NO_DATA_NAMES = {"license", "licence", "readme", "copying", "authors"}


@dataclass(frozen=True)
class Run:
    """One recording: its ``name``, and for each source its file and, where that is another one, that of its time."""

    name: str
    files: Mapping[str, Path]
    times: Mapping[str, Path]


def natural(path: Path) -> list[tuple[int, int, str]]:
    """The key of an order in which run_2 comes before run_10."""
    parts = re.split(r"(\d+)", str(path))
    return [(1, int(part), "") if part.isdigit() else (0, 0, part) for part in parts]


def expand(arguments: Sequence[str]) -> list[Path]:
    """The files that file names, folders and patterns stand for: in the order given, those of each in their own.

    Hidden files are left out. Raises ``InvalidValueError`` for what matches no file.
    """
    files: dict[Path, None] = {}
    for argument in arguments:
        path = Path(argument).expanduser()
        matches = [path] if path.exists() else [Path(match) for match in glob(str(path), recursive=True)]
        inside = [file for match in sorted(matches, key=natural) for file in _files(match)]
        if not inside:
            raise InvalidValueError(f"'{argument}' matches no file: give a file, a folder or a quoted pattern")
        files |= dict.fromkeys(inside)
    return list(files)


def runs_of(files: Sequence[Path], log_map: LogMap) -> list[Run]:
    """The runs that the ``files`` hold, in their order; each has a file for every source that is used.

    Raises ``InvalidValueError`` where a source has no file, or where it is open which files belong together.
    """
    sources = log_map.used
    matches = {source.name: _matches(source.file, files) for source in sources}
    for source in sources:
        if not matches[source.name]:
            raise InvalidValueError(
                f"source.{source.name}: no file given ends with '{source.file}' ({len(files)} given): give it, or mend "
                "file in the map"
            )
    groups = _by_folder(matches, log_map.runs) if log_map.runs else _grouped(matches)
    return [Run(name, chosen, _times(sources, chosen, files)) for name, chosen in groups.items()]


def unused(files: Sequence[Path], runs: Sequence[Run]) -> list[Path]:
    """The files that no run holds."""
    used = {path for run in runs for path in (*run.files.values(), *run.times.values())}
    return [path for path in files if path not in used]


def _files(path: Path) -> list[Path]:
    if not path.is_dir():
        return [path]
    inside = (file for file in path.rglob("*") if file.is_file())
    shown = [file for file in inside if not any(part.startswith(".") for part in file.relative_to(path).parts)]
    return sorted(shown, key=natural)


def _matches(ending: str, files: Sequence[Path]) -> dict[Path, str]:
    """The files whose paths end so, each with what stands before that.

    Whole parts of a path count, or patterns of them; of an ending that begins with a mark, such as ``.csv``, any end.
    """
    if not ending:
        data = [f for f in files if f.suffix.casefold() not in NO_DATA and f.stem.casefold() not in NO_DATA_NAMES]
        return {file: str(file) for file in data}
    wanted = PurePath(ending).parts
    exact = {}
    for file in files:
        end = file.parts[-len(wanted) :]
        if len(end) == len(wanted) and all(fnmatchcase(part, wish) for part, wish in zip(end, wanted, strict=True)):
            exact[file] = str(Path(*file.parts[: -len(wanted)]))
    if exact or wanted[0][0].isalnum():
        return exact
    return {file: str(file).removesuffix(ending) for file in files if str(file).endswith(ending)}


def _grouped(matches: Mapping[str, Mapping[Path, str]]) -> dict[str, dict[str, Path]]:
    """Runs without a pattern: files in one folder belong together, else the first of each source, the second, ..."""
    counts = {len(paths) for paths in matches.values()}
    before = [list(paths.values()) for paths in matches.values()]
    unique = all(len(set(places)) == len(places) for places in before)
    if unique and len({frozenset(places) for places in before}) == 1:
        groups: dict[str, dict[str, Path]] = {}
        for name, paths in matches.items():
            for path, place in paths.items():
                groups.setdefault(place, {})[name] = path
        return groups
    if len(counts) == 1:
        ordered = {name: list(paths) for name, paths in matches.items()}
        return {str(i): {name: paths[i] for name, paths in ordered.items()} for i in range(counts.pop())}
    numbers = ", ".join(f"{len(paths)} of source.{name}" for name, paths in matches.items())
    raise InvalidValueError(
        f'the files given are {numbers}: as many of each were expected, or runs = "run_*", the folders of the runs'
    )


def _by_folder(matches: Mapping[str, Mapping[Path, str]], pattern: str) -> dict[str, dict[str, Path]]:
    groups: dict[str, dict[str, Path]] = {}
    for name, paths in matches.items():
        for path in paths:
            place = next((i for i, part in enumerate(path.parts) if fnmatchcase(part, pattern)), None)
            if place is None:
                continue
            run = str(Path(*path.parts[: place + 1]))
            if name in groups.setdefault(run, {}):
                raise InvalidValueError(f"{run} has several files for source.{name}: one in each run was expected")
            groups[run][name] = path
    if not groups:
        raise InvalidValueError(
            f"no file given lies in a folder '{pattern}': give such folders, or mend runs in the map"
        )
    for run, chosen in groups.items():
        for name in matches:
            if name not in chosen:
                raise InvalidValueError(f"{run} has no file for source.{name}: one in each run was expected")
    return dict(sorted(groups.items(), key=lambda group: natural(Path(group[0]))))


def _times(sources: Sequence[Source], chosen: Mapping[str, Path], files: Sequence[Path]) -> dict[str, Path]:
    times = {}
    for source in sources:
        if source.time.file:
            beside = chosen[source.name].parent
            near = {f: place for f, place in _matches(source.time.file, files).items() if Path(place) == beside}
            near = near or _matches(
                source.time.file, [f for f in files if beside in f.parents or f.parent in beside.parents]
            )
            if len(near) != 1:
                raise InvalidValueError(
                    f"source.{source.name}: {len(near) or 'no'} file{'s' * (len(near) != 1)} given near "
                    f"{chosen[source.name]} end with '{source.time.file}', its time: give one"
                )
            times[source.name] = next(iter(near))
    return times
