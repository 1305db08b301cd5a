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

    def note(self, text: str) -> None:
        """A plain line."""
        self._print(text)

    def warn(self, text: str) -> None:
        """A line that says what may be wrong."""
        self._print(f"warning: {text}")

    def table(self, header: Sequence[str], rows: Sequence[Sequence[str]], *, title: str = "") -> None:
        """A table on stderr."""
        show_table(header, rows, title=title, file=sys.stderr)

    @contextmanager
    def progress(self, label: str) -> Iterator[Progress]:
        """A bar that appears with the first report and goes when the work is done."""
        if not sys.stderr.isatty():
            yield silent
            return
        from rich.console import Console as RichConsole  # noqa: PLC0415
        from rich.progress import BarColumn, TextColumn, TimeRemainingColumn  # noqa: PLC0415
        from rich.progress import Progress as RichProgress  # noqa: PLC0415

        columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:>3.0f} %"))
        with RichProgress(*columns, TimeRemainingColumn(), console=RichConsole(stderr=True), transient=True) as bars:
            bar = bars.add_task(label, total=None)
            self._bars = bars
            try:
                yield lambda done, total: bars.update(bar, completed=done, total=total)
            finally:
                self._bars = None

    def _print(self, text: str) -> None:
        if self._bars is not None:
            self._bars.console.print(text, markup=False, highlight=False, soft_wrap=True)
        else:
            print(text, file=sys.stderr, flush=True)


def show_table(header: Sequence[str], rows: Sequence[Sequence[str]], *, title: str, file: IO[str]) -> None:
    """A table of texts; columns after the first align right. Off a terminal no row is folded or cut."""
    from rich.box import SIMPLE  # noqa: PLC0415
    from rich.console import Console as RichConsole  # noqa: PLC0415
    from rich.table import Table  # noqa: PLC0415
    from rich.text import Text  # noqa: PLC0415

    table = Table(title=title or None, box=SIMPLE, title_justify="left", title_style="bold", pad_edge=False)
    for i, name in enumerate(header):
        table.add_column(Text(name), justify="left" if i == 0 else "right", overflow="fold")
    for row in rows:
        table.add_row(*(Text(cell) for cell in row))
    width = None if file.isatty() else 400
    RichConsole(file=file, width=width).print(table)
