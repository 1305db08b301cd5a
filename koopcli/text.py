"""Texts that somebody else wrote: what of them a terminal may be shown, and the files that hold them."""

from __future__ import annotations

import codecs
from pathlib import Path

OTHER = {
    "UTF-32": (codecs.BOM_UTF32_LE, codecs.BOM_UTF32_BE),  # first: the mark of UTF-16 begins that of UTF-32
    "UTF-16": (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE),
}


def printable(text: str) -> str:
    """``text`` with everything replaced that would steer a terminal."""
    return text if text.isprintable() else "".join(c if c.isprintable() else "�" for c in text)


def one_line(text: str) -> str:
    """``text`` on a single line, with nothing in it that would steer a terminal."""
    return printable(" ".join(text.split()))


def read_text(path: Path) -> str:
    """The text of a user's file, with a byte order mark or without.

    Raises ``OSError`` where it cannot be read, ``ValueError`` where it is not UTF-8: its text is the reason alone.
    """
    content = path.read_bytes()
    for name, marks in OTHER.items():
        if content.startswith(marks):
            raise ValueError(f"it is {name}: save it as UTF-8")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        raise ValueError(f"line {line} is not UTF-8: save the file as UTF-8") from error
