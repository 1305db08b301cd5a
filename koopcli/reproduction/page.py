"""The report as one page that needs nothing else: tables, pictures, how each was made."""

from __future__ import annotations

import base64
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from html import escape
from importlib.resources import files

from koopcli.figures.registry import FIGURES
from koopcli.reproduction import turnable
from koopcli.reproduction.illustrations import Illustration, provenance
from koopcli.reproduction.report import Table

LEAD = (
    "V. Cibulka, T. Haniš and M. Hromčík, “Data-driven identification of vehicle dynamics using Koopman operator”, "
    "reproduced: what the paper states beside what was found here, and every figure with the command that makes it."
)
STORE = (
    "Commands find what they name in the store that this report was written to: ./artefacts in the folder they are run "
    "in, or where --store or KOOP_STORE point. koop show NAME tells every setting behind an artefact."
)

FOLDED_BEYOND = 12  # artefacts named in a command


_text = partial(escape, quote=False)


@dataclass(frozen=True)
class Section:
    """What a page says of one method: ``every`` is the table of all its evaluations."""

    name: str
    title: str
    tables: Sequence[Table]
    notes: Sequence[str]
    illustrations: Sequence[Illustration]
    every: Table


def page(sections: Sequence[Section], command: str, made_by: str, library: str | None) -> str:
    """The page. ``command`` makes it afresh; ``library`` turns the views, without it pictures stand for them."""
    links = "".join(f'<a href="#{one.name}">{_text(one.title)}</a>' for one in sections)
    body = "".join("".join(_section(one, views=library is not None)) for one in sections)
    script = "" if library is None else f"<script>{library}</script><script>{_file('page.js')}</script>"
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        '<link rel="icon" href="data:,">'
        f"<title>Paper versus here</title><style>{_file('page.css')}</style></head><body>"
        f'<h1>Koopman predictors of vehicle dynamics: paper versus here</h1><p class="lead">{_text(LEAD)}</p>'
        f"<nav>{links}</nav>{body}"
        f"<footer><p>Made by <code>{_text(command)}</code>, {_text(made_by)}. {_text(STORE)}</p></footer>"
        f"{script}</body></html>\n"
    )


def _section(section: Section, *, views: bool) -> Iterator[str]:
    yield f'<section id="{section.name}"><h2>{_text(section.title)}</h2>'
    yield from map(_table, section.tables)
    yield '<h3>What it means</h3><ul class="notes">'
    yield from (f"<li>{_text(note)}</li>" for note in section.notes)
    yield '</ul><h3>Figures</h3><div class="figures">'
    sides = {_drawn(one): one.drawing for one in section.illustrations if one.figure == "error-side"}
    for i, one in enumerate(section.illustrations):
        view = None
        if views and one.figure == "error-map" and one.drawing is not None:
            view = turnable.view(one.drawing, sides.get(_drawn(one)))
        yield from _figure(one, f"{section.name}-{i}", view)
    yield f'</div><details class="every"><summary>Every evaluation</summary>{_table(section.every)}</details></section>'


def _drawn(one: Illustration) -> tuple[str, ...]:
    return tuple(record.name for record in one.draws)


def _figure(one: Illustration, name: str, view: str | None) -> Iterator[str]:
    run = "" if one.run == "here" else f" <em>With {_text(one.run)}.</em>"
    yield f'<figure id="{name}" data-figure="{one.figure}">'
    if one.drawing is None:
        yield f'<p class="missing">Not drawn: {_text(one.reason)}.</p>'
    else:
        if view is not None:
            yield f'<div class="view" id="{name}-view"></div>'
            yield f'<script type="application/json" id="{name}-view-data">{view}</script>'
            yield '<p class="hint">Drag to turn, pinch or scroll to zoom, point at a ball to read it.</p>'
        image = base64.b64encode(one.drawing.image).decode()
        about = escape(FIGURES[one.figure].about)
        yield f'<img src="data:image/{one.drawing.format};base64,{image}" alt="{about}">'
    yield f"<figcaption>{_text(one.caption)}{run}"
    if one.drawing is not None:
        yield _command(one)
        yield "<details><summary>Where it comes from</summary><dl>"
        yield from (f"<dt>{_text(what)}</dt><dd>{_text(text)}</dd>" for what, text in provenance(one))
        yield "</dl></details>"
    yield "</figcaption></figure>"


def _command(one: Illustration) -> str:
    """The command, folded where it names many artefacts."""
    code = f"<code>{_text(one.command)}</code>"
    if len(one.draws) <= FOLDED_BEYOND:
        return f'<p class="command">{code}</p>'
    return f"<details><summary>Made of {len(one.draws)} evaluations by</summary>{code}</details>"


def _table(table: Table) -> str:
    head = "".join(f'<th scope="col">{_text(cell)}</th>' for cell in table.header)
    rows = "".join(
        f'<tr><th scope="row">{_indented(row[0])}</th>{"".join(f"<td>{_text(cell)}</td>" for cell in row[1:])}</tr>'
        for row in table.rows
    )
    kind = ' class="words"' if table.words else f' class="left-{table.left}"' if table.left > 1 else ""
    return (
        f'<h4>{_text(table.title)}</h4><div class="wide"><table{kind}><thead><tr>{head}</tr></thead>'
        f"<tbody>{rows}</tbody></table></div>"
    )


def _indented(text: str) -> str:
    """A row's name; blanks in front of it put it under the one before."""
    name = text.lstrip()
    return "&emsp;" * ((len(text) - len(name)) // 2) + _text(name)


def _file(name: str) -> str:
    return files("koopcli.reproduction").joinpath(name).read_text(encoding="utf-8")
