"""Files that a command writes for the user, beside the store."""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from io import StringIO
from pathlib import Path
from stat import S_IMODE
from typing import Annotated, Any, get_args

import typer

from koopcli.cli.invocation import write_csv
from koopcli.config.pictures import ImageFormat
from koopcli.console import Console
from koopcli.errors import InvalidValueError, StorageError, UsageError
from koopcli.paths import is_file, is_folder

OutputOption = Annotated[
    Path | None, typer.Option("-o", "--output", metavar="FILE", help="Write the image: .png, .svg or .pdf.")
]
CsvOption = Annotated[
    Path | None,
    typer.Option("--csv", metavar="FILE", help="Write the numbers that are drawn, as a table; - writes it to stdout."),
]
STDOUT = Path("-")


def image_format(output: Path | None) -> ImageFormat:
    """The format of the image that is asked for. Raises ``InvalidValueError`` for an unknown ending."""
    if output is None:
        return "png"
    ending = output.suffix.lower().lstrip(".")
    for image in get_args(ImageFormat):
        if ending == image:
            return image  # type: ignore[no-any-return]
    raise InvalidValueError(f"{output}: unknown ending; write to a file ending in .{', .'.join(get_args(ImageFormat))}")


def check_outputs(output: Path | None, csv: Path | None, *, as_json: bool) -> None:
    """Refuse files that cannot be written, and two things on stdout, before anything is made."""
    if csv == STDOUT and as_json:
        raise UsageError("--csv - and --json both go to stdout: choose one, or name a file")
    if output is not None and csv is not None and output.resolve() == csv.resolve():
        raise UsageError(f"{output} cannot be both the image and its numbers: name two files")
    for path in (output, None if csv == STDOUT else csv):
        if path is not None:
            _check(path)


def write_outputs(console: Console, image: bytes, output: Path | None, content: Any, csv: Path | None) -> None:
    """Write the image and the table of ``content`` where they are asked for, and say so."""
    if output is not None:
        _write(output, image)
        console.note(f"wrote {output}")
    if csv == STDOUT:
        write_csv(content, sys.stdout)
    elif csv is not None:
        text = StringIO()
        write_csv(content, text)
        _write(csv, text.getvalue().encode())
        console.note(f"wrote {csv}")


def write_text(path: Path, text: str) -> None:
    """Write a file of ``text``. Raises ``StorageError`` where that is not possible."""
    _write(path, text.encode())


def _check(path: Path) -> None:
    try:
        writable = not is_folder(path) and os.access(path if _in_place(path) else path.parent, os.W_OK)
    except OSError as error:
        raise _refused(path, error) from error
    if not writable:
        raise StorageError(f"cannot write {path}: name a file in a folder that can be written to")


def _in_place(path: Path) -> bool:
    """Whether ``path`` must be written where it is: a device, a pipe, or a link that stays one."""
    return path.exists() and (path.is_symlink() or not is_file(path))


def _write(path: Path, content: bytes) -> None:
    from koopcli.store.files import own_name, sync, write_new

    beside = path.with_name(f".{own_name()}")  # the file's own name may leave no room for more
    try:
        if _in_place(path):
            path.write_bytes(content)
            return
        write_new(beside, content, S_IMODE(path.stat().st_mode) if path.exists() else None)
        os.replace(beside, path)
        with suppress(PermissionError):  # of a folder that can be written to but not read
            sync(path.parent)
    except OSError as error:
        raise _refused(path, error) from error
    finally:
        beside.unlink(missing_ok=True)


def _refused(path: Path, error: OSError) -> StorageError:
    from koopcli.store.remedies import remedy

    return StorageError(f"cannot write {path}: {error.strerror}; {remedy(error, 'name another file')}")
