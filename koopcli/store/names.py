"""Where a store is, and the names in it, which are found without opening anything."""

from __future__ import annotations

import os
import re
from pathlib import Path

from koopcli.errors import InvalidValueError, StorageError

SHORT = 12  # digits of a key in a name
STAGE = re.compile(r"[a-z][a-z0-9-]{0,63}")
DIGEST = re.compile(r"[0-9a-f]{64}")
KEY = re.compile(r"([0-9a-f]{64})\.json")


def store_root(given: str | Path | None = None) -> Path:
    """The store's folder: ``given``, else ``$KOOP_STORE`` unless that is empty, else ``./artefacts``."""
    if given is not None and not str(given).strip():
        raise InvalidValueError("the name of the store is empty: give a folder, or leave it out")
    named = os.environ.get("KOOP_STORE", "")
    text = str(given or (named if named.strip() else "artefacts"))
    try:
        return Path(text).expanduser()
    except RuntimeError as error:
        raise StorageError(f"the store {text}: {error}") from error


def index(root: Path) -> list[tuple[str, str]]:
    """(stage, key) of every record, by stage; none where there is no store. Raises ``OSError``."""
    matches = []
    try:
        for stage in os.scandir(root / "records"):
            if stage.is_dir():
                matches += [(stage.name, KEY.fullmatch(file.name)) for file in os.scandir(stage)]
    except FileNotFoundError:
        return []
    return sorted((stage, match[1]) for stage, match in matches if match)


def is_name(name: object) -> bool:
    """Whether ``name`` is "stage/key", which leads to a record and nowhere else."""
    stage, _, key = name.partition("/") if isinstance(name, str) else ("", "", "")
    return bool(STAGE.fullmatch(stage) and DIGEST.fullmatch(key))


def short_name(name: str) -> str:
    """ "stage/key" as commands print it."""
    stage, _, key = name.partition("/")
    return f"{stage}/{key[:SHORT]}"
