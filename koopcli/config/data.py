"""Shipped data files: beside the package in a wheel, at the top of a checkout."""

from __future__ import annotations

from pathlib import Path

from koopcli.checks import candidates
from koopcli.errors import InvalidValueError, UnknownNameError
from koopcli.paths import is_file


def data_folder() -> Path:
    """The folder of shipped vehicles and experiments."""
    package = Path(__file__).resolve().parents[1]
    installed = package / "data"
    return installed if installed.is_dir() else package.parent / "data"


def locate(folder: str, name: str, what: str, relative_to: Path = Path()) -> Path:
    """The shipped TOML file ``name`` of ``folder``, or the user's own: anything with a slash or ending in .toml,
    found from the folder ``relative_to``.

    Raises ``UnknownNameError`` for a name that is not shipped, ``InvalidValueError`` for a path without a file.
    """
    if name.endswith(".toml") or "/" in name:
        try:
            path = relative_to / Path(name).expanduser()
            exists = is_file(path)
        except (OSError, RuntimeError, ValueError) as error:
            raise InvalidValueError(f"{name}: cannot read the {what} file: {error}") from error
        if not exists:
            raise InvalidValueError(f"{name}: there is no such {what} file")
        return path
    shipped = {path.stem: path for path in sorted((data_folder() / folder).glob("*.toml"))}
    if name not in shipped:
        raise UnknownNameError(f"unknown {what} '{name}'{candidates(name, shipped)}; a file is named by its path")
    return shipped[name]
