"""What the user sees: notes, warnings and progress on stderr, and lines and tables.

Nothing of what is shown here steers a terminal, whoever wrote it.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import IO, TYPE_CHECKING

from koopcli.progress import Progress, silent
from koopcli.text import printable

if TYPE_CHECKING:
    from rich.progress import Progress as Bars

BETWEEN, LEAST = 3, 8  # letters between columns; and of a column, which is room for a size or a time


class Console:
    """Speaks on stderr; bars appear only on a terminal."""

    def __init__(self) -> None:
        self._bars: Bars | None = None
        self._warned: set[str] = set()

    def note(self, text: str) -> None:
        """A plain line."""
        self._print(text)

    def warn(self, text: str) -> None:
        """A line that says what may be wrong, once."""
        if text not in self._warned:
            self._warned.add(text)
            self._print(f"warning: {text}")

    @contextmanager
    def progress(self, label: str) -> Iterator[Progress]:
        """A bar for the time of a ``with``; bars inside one another share the display."""
        if not sys.stderr.isatty():
            yield silent
            return
        outermost = self._bars is None
        bars = self._bars = self._bars or _bars()
        if outermost:
            bars.start()
        bar = bars.add_task(label, total=None)
        try:
            yield lambda done, total: bars.update(bar, completed=done, total=total)
        finally:
            bars.remove_task(bar)
            if outermost:
                bars.stop()
                self._bars = None

    def _print(self, text: str) -> None:
        if self._bars is not None:
            self._bars.console.print(printable(text), markup=False, highlight=False, emoji=False, soft_wrap=True)
        else:
            print(printable(text), file=sys.stderr, flush=True)


def _bars() -> Bars:
    from rich.console import Console as RichConsole  # noqa: PLC0415
    from rich.progress import BarColumn, TextColumn, TimeRemainingColumn  # noqa: PLC0415
    from rich.progress import Progress as RichProgress  # noqa: PLC0415

    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:>3.0f} %"))
    return RichProgress(*columns, TimeRemainingColumn(), console=RichConsole(stderr=True), transient=True)


def show_line(text: str, file: IO[str] | None = None) -> None:
    """A line of text on stdout or ``file``."""
    print(printable(text), file=file or sys.stdout)


def show_table(
    header: Sequence[str],
    rows: Sequence[Sequence[str]],
    *,
    title: str = "",
    left: int = 1,
    lines: bool = False,
    file: IO[str] | None = None,
) -> None:
    """A table of texts on stdout or ``file``, its first ``left`` columns flush left.

    No row is ever folded. On a terminal the widest columns are cut to its width, but never the first, which has the
    names; elsewhere nothing is cut. With ``lines`` a cell may have several, and is folded instead of cut.
    """
    from rich.box import SIMPLE  # noqa: PLC0415
    from rich.cells import cell_len  # noqa: PLC0415
    from rich.console import Console as RichConsole  # noqa: PLC0415
    from rich.table import Table  # noqa: PLC0415
    from rich.text import Text  # noqa: PLC0415

    target = file or sys.stdout
    clean = _lines if lines else printable
    columns = [[clean(cell) for cell in column] for column in zip(header, *rows, strict=True)]
    widths = [max(cell_len(line) for cell in column for line in cell.split("\n")) for column in columns]
    between = BETWEEN * len(widths)
    if target.isatty():
        widths = cut_widths(widths, RichConsole(file=target).width - between)
    table = Table(box=SIMPLE, pad_edge=False)
    for i, (column, width) in enumerate(zip(columns, widths, strict=True)):
        table.add_column(Text(column[0]), "left" if i < left else "right", width=width, no_wrap=not lines)
    for cells in zip(*(column[1:] for column in columns), strict=True):
        table.add_row(*map(Text, cells))
    console = RichConsole(file=target, width=sum(widths) + between)
    if title:
        console.print(Text(f"\n{printable(title)}", style="bold"), soft_wrap=True)
    console.print(table)


def _lines(text: str) -> str:
    return "\n".join(map(printable, text.split("\n")))


def cut_widths(widths: Sequence[int], room: int) -> list[int]:
    """Widths of columns in no more than ``room``: the widest are cut, to one width, the first never.

    None is cut below ``LEAST``, for which a terminal may be too narrow.
    """
    first, *others = widths
    most = max(others, default=0)
    while most > LEAST and first + sum(min(width, most) for width in others) > room:
        most -= 1
    return [first, *(min(width, most) for width in others)]
