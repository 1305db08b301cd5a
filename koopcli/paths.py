"""What lies at a path that a user names, told in the same way by every version of Python; and where paths are POSIX's.

``pathlib`` answers "no" to some questions that the system refuses to answer, and from Python 3.14 to all of them.
"""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path

from koopcli.errors import StorageError

NOTHING_THERE = (errno.ENOENT, errno.ENOTDIR, errno.ELOOP)


def require_posix() -> None:
    """Raise ``StorageError`` on Windows, whose files have neither the locks nor the renames that a store rests on."""
    if os.name != "posix":
        raise StorageError("koop needs the files and locks of Linux or macOS: on Windows, run it in WSL")


def is_file(path: Path) -> bool:
    """Whether ``path`` leads to a regular file. Raises ``OSError`` where that cannot be told, as for a long name."""
    return stat.S_ISREG(_mode(path))


def is_folder(path: Path) -> bool:
    """Whether ``path`` leads to a folder. Raises ``OSError`` where that cannot be told."""
    return stat.S_ISDIR(_mode(path))


def _mode(path: Path) -> int:
    try:
        return path.stat().st_mode
    except OSError as error:
        if error.errno in NOTHING_THERE:
            return 0
        raise
