"""Times that are written as dates, in s since 1970."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import UTC, datetime

import numpy as np

from koopcli.records import FloatArray

FINER = re.compile(r"(\.\d{6})\d+")  # than microseconds


class DateError(ValueError):
    """A text that is not written so; ``row``: its place."""

    def __init__(self, row: int) -> None:
        super().__init__(row)
        self.row = row


def seconds_of(texts: Sequence[str], layout: str) -> FloatArray:
    """The times in s (n,) of ``texts`` that are written as ``layout``, in UTC where they say no other zone.

    Rows within one second are parsed once. Raises ``DateError`` for the first text that is not written so.
    """
    parts = layout.endswith("%f") and layout.count("%f") == 1 and layout[-3:-2] not in ("", "%") and "%z" not in layout
    mark, whole = (layout[-3], layout[:-3]) if parts else ("", layout)
    known: dict[str, float] = {}
    seconds = np.empty(len(texts))
    for row, text in enumerate(texts):
        head, split, digits = text.rpartition(mark) if parts else (text, "", "0")
        if parts and not (split and digits.isascii() and digits.isdigit()):
            raise DateError(row)
        if head not in known:
            try:
                known[head] = _second(head, whole)
            except ValueError:
                raise DateError(row) from None
        seconds[row] = known[head] + int(digits) / 10 ** len(digits)
    return seconds


def _second(text: str, layout: str) -> float:
    moment = datetime.strptime(FINER.sub(r"\1", text), layout)
    return (moment if moment.tzinfo is not None else moment.replace(tzinfo=UTC)).timestamp()
