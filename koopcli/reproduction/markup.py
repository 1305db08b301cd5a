"""The parts of a report's page: tables, commands and figures as HTML."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from html import escape
from itertools import zip_longest

from koopcli.figures.kit.registry import FIGURES
from koopcli.reproduction.columns import aligned, is_numeric
from koopcli.reproduction.illustrations import Illustration, provenance
from koopcli.reproduction.images import address
from koopcli.reproduction.report import Table

FOLDED_BEYOND = 12  # artefacts named in a command

COMMAND = "command"  # header of a column that holds some

text = partial(escape, quote=False)


def table(shown: Table) -> str:
    """A table in a frame: names and words flush left, numbers in line at their points."""
    columns = [list(column) for column in zip_longest(*shown.rows, fillvalue="")] or [[] for _ in shown.header]
    kinds = [not shown.words and i >= shown.left and is_numeric(column) for i, column in enumerate(columns)]
    cells = [
        [command(cell) for cell in column]
        if name == COMMAND
        else aligned(column)
        if numeric
        else [text(cell) for cell in column]
        for name, column, numeric in zip(shown.header, columns, kinds, strict=True)
    ]
    marks = [' class="n"' if numeric else "" for numeric in kinds]
    head = "".join(f'<th scope="col"{mark}>{text(cell)}</th>' for cell, mark in zip(shown.header, marks, strict=True))
    rows = []
    for i in range(len(shown.rows)):
        rest = (cells[k][i] if k < 1 else f"<td{marks[k]}>{_lines(cells[k][i])}</td>" for k in range(1, len(cells)))
        rows.append(f'<tr><th scope="row">{_indented(shown.rows[i][0])}</th>{"".join(rest)}</tr>')
    kind = ' class="words"' if shown.words else ""
    return f'<div class="wide"><table{kind}><thead><tr>{head}</tr></thead><tbody>{"".join(rows)}</tbody></table></div>'


def folded(shown: Table, kind: str = "folded") -> str:
    """A table behind its title."""
    return f'<details class="{kind}"><summary>{text(shown.title)}</summary>{table(shown)}</details>'


def _lines(cell: str) -> str:
    return cell.replace("\n", "<br>")


def _indented(name: str) -> str:
    """A row's name; blanks in front of it put it under the one before."""
    stripped = name.lstrip()
    return "&emsp;" * ((len(name) - len(stripped)) // 2) + text(stripped)


def command(line: str) -> str:
    """A command that breaks between its words alone."""
    words = " ".join(f"<span>{text(word)}</span>" for word in line.split(" "))
    return f'<p class="command"><code>{words}</code></p>'


def figure(shown: Illustration, *, brief: bool = False) -> Iterator[str]:
    """A picture with its caption and the command that makes it, which is folded where it is to be ``brief``."""
    run = "" if shown.run == "here" else f" <em>With {text(shown.run)}.</em>"
    yield f'<figure data-figure="{shown.figure}">'
    if shown.drawing is None:
        yield f'<p class="missing">Not drawn: {text(shown.reason)}.</p>'
    else:
        yield f'<img src="{address(shown.drawing)}" alt="{escape(FIGURES[shown.figure].about)}">'
    yield f"<figcaption>{text(shown.caption)}{run}"
    if shown.drawing is not None:
        many = len(shown.draws) > FOLDED_BEYOND
        if not brief and not many:
            yield command(shown.command)
        origin = (
            f"Made of {len(shown.draws)} evaluations: the command, and where it comes from"
            if many
            else "Where it comes from"
        )
        yield f"<details><summary>{origin}</summary>"
        if brief or many:
            yield command(shown.command)
        yield "<dl>"
        yield from (f"<dt>{text(what)}</dt><dd>{text(detail)}</dd>" for what, detail in provenance(shown))
        yield "</dl></details>"
    yield "</figcaption></figure>"


def listed(items: Sequence[str], kind: str) -> str:
    """Sentences, each by itself."""
    return f'<ul class="{kind}">{"".join(f"<li>{text(item)}</li>" for item in items)}</ul>' if items else ""
