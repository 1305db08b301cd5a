"""What the user sees besides results: notes, warnings, progress and one-line errors, all on stderr."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import IO, TYPE_CHECKING

from koopcli.progress import Progress, silent

if TYPE_CHECKING:
    from rich.progress import Progress as Bars


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
            self._bars.console.print(text, markup=False, highlight=False, soft_wrap=True)
        else:
            print(text, file=sys.stderr, flush=True)


def _bars() -> Bars:
    from rich.console import Console as RichConsole  # noqa: PLC0415
    from rich.progress import BarColumn, TextColumn, TimeRemainingColumn  # noqa: PLC0415
    from rich.progress import Progress as RichProgress  # noqa: PLC0415

    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:>3.0f} %"))
    return RichProgress(*columns, TimeRemainingColumn(), console=RichConsole(stderr=True), transient=True)


def show_table(
    header: Sequence[str], rows: Sequence[Sequence[str]], *, title: str = "", left: int = 1, file: IO[str] | None = None
) -> None:
    """A table of texts on stdout or ``file``, its first ``left`` columns flush left.

    Off a terminal no row is folded or cut.
    """
    from rich.box import SIMPLE  # noqa: PLC0415
    from rich.console import Console as RichConsole  # noqa: PLC0415
    from rich.table import Table  # noqa: PLC0415
    from rich.text import Text  # noqa: PLC0415

    target = file or sys.stdout
    table = Table(box=SIMPLE, pad_edge=False)
    for i, name in enumerate(header):
        table.add_column(Text(name), justify="left" if i < left else "right", overflow="fold")
    for row in rows:
        table.add_row(*(Text(cell) for cell in row))
    console = RichConsole(file=target, width=None if target.isatty() else 400)
    if title:
        console.print(Text(f"\n{title}", style="bold"))
    console.print(table)
