"""Numbers in a column of a table, put in line at their points without a character that is not theirs.

A number is padded to either side by what the longest of its kind has more: text that is laid out and neither seen nor
copied, which the style sheet takes from attributes.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from html import escape

NUMBER = re.compile(r"(?<![\w.])\(?[-−]?\d+(?:[ \u2009\u202f]\d{3})*(?:\.\d+)?(?:e[-+]?\d+)?(?![\w])\)?")
LEADS = re.compile(r"[±“]?[-−]?\d")
NOTHING = ("", "–")


def is_numeric(cells: Sequence[str]) -> bool:
    """Whether a column is one of numbers: most of its cells that say anything begin with one."""
    filled = [cell for cell in cells if cell.strip() not in NOTHING]
    return 2 * sum(LEADS.match(cell.strip()) is not None for cell in filled) > len(filled)


def aligned(cells: Sequence[str]) -> list[str]:
    """The cells of a column as HTML. Cells that differ in their numbers alone are of a kind, and line up."""
    kinds: dict[str, list[int]] = {}
    for i, cell in enumerate(cells):
        kinds.setdefault(NUMBER.sub("#", cell), []).append(i)
    texts = [""] * len(cells)
    for rows in kinds.values():
        numbers = [NUMBER.findall(cells[i]) for i in rows]
        slots = [[_halves(number) for number in slot] for slot in zip(*numbers, strict=True)]
        widest = [tuple(max(half, key=len) for half in zip(*slot, strict=True)) for slot in slots]
        for i, own in zip(rows, numbers, strict=True):
            texts[i] = "".join(_joined(NUMBER.split(cells[i]), own, widest))
    return texts


def _halves(number: str) -> tuple[str, str]:
    """A number before and from its point, or from the sign of its power of ten, without its brackets."""
    bare = number.strip("()")
    whole = re.match(r"[^.e]*", bare)
    assert whole is not None
    return whole[0], bare[whole.end() :]


def _joined(texts: Sequence[str], own: Sequence[str], widest: Sequence[tuple[str, ...]]) -> Iterator[str]:
    yield escape(texts[0], quote=False)
    for text, number, (longest, fullest) in zip(texts[1:], own, widest, strict=True):
        whole, rest = _halves(number)
        before, after = longest[: len(longest) - len(whole)], fullest[len(rest) :]
        pads = "".join(f' data-{side}="{pad}"' for side, pad in (("l", before), ("r", after)) if pad)
        yield f"<span{pads}>{number}</span>" if pads else number
        yield escape(text, quote=False)
