"""CSV and other text with a row in each line."""

from __future__ import annotations

from pathlib import Path

from koopcli.logs.entries import Source
from koopcli.logs.formats.table import Table
from koopcli.logs.rows import line_of, read_columns, read_words
from koopcli.logs.text import sniff


def open_table(path: Path, source: Source) -> Table:
    """The table of a text file; ``source`` says what of its layout need not be looked for."""
    layout = sniff(
        path,
        delimiter=source.delimiter,
        decimal=source.decimal,
        comment=source.comment,
        header=source.header,
        units_row=source.units_row,
        quoted_rows=source.unquote_rows,
    )
    return Table(
        path,
        layout.names,
        layout.units,
        read=lambda places: read_columns(path, layout, places),
        words=lambda place: read_words(path, layout, place),
        line=lambda row: line_of(path, layout, row),
    )
