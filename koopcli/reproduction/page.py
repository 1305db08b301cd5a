"""The report as one page that needs nothing else: a first screen, figures and how each was made, tables."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.resources import files

from koopcli.reproduction.illustrations import Illustration
from koopcli.reproduction.markup import command, figure, folded, listed, text
from koopcli.reproduction.opening import TITLE, Opening, screen
from koopcli.reproduction.report import Table

PAPER = (
    "The paper is V. Cibulka, T. Haniš and M. Hromčík, “Data-driven identification of vehicle dynamics using Koopman "
    "operator”."
)
STORE = (
    "A command finds the artefacts that it names in the store that this report was written to: ./artefacts in the "
    "working folder, or the folder that --store or KOOP_STORE gives. koop show NAME prints every setting behind an "
    "artefact."
)
SCRIPTS = ("page.js", "ghosts.js")


@dataclass(frozen=True)
class Section:
    """What a page says of one method: ``every`` is the table of all its evaluations."""

    name: str
    title: str
    tables: Sequence[Table]
    notes: Sequence[str]
    illustrations: Sequence[Illustration]
    every: Table


def page(first: Opening, sections: Sequence[Section], line: str, made_by: str) -> str:
    """The page. ``line`` is the command that makes it afresh."""
    links = "".join(f'<a href="#{section.name}">{text(section.title)}</a>' for section in sections)
    body = "".join("".join(_section(section, first.picture)) for section in sections)
    scripts = "".join(f"<script>{_file(name)}</script>" for name in SCRIPTS)
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        '<link rel="icon" href="data:,">'
        f"<title>{TITLE}</title><style>{_file('page.css')}</style></head><body>"
        f"{''.join(screen(first))}<nav>{links}</nav><main>{body}</main>"
        f"<footer><p>{text(PAPER)}</p><p>{text(made_by)} made this report by</p>{command(line)}"
        f"<p>{text(STORE)}</p></footer>{scripts}</body></html>\n"
    )


def _section(section: Section, opening: Illustration | None) -> Iterator[str]:
    """Figures, but for the one that opens the report, what they mean, and tables."""
    yield f'<section id="{section.name}"><h2>{text(section.title)}</h2><div class="figures">'
    for illustration in section.illustrations:
        if illustration is not opening:
            yield from figure(illustration)
    meaning = f"<h3>What it means</h3>{listed(section.notes, 'notes')}" if section.notes else ""
    yield f"</div>{meaning}<h3>Tables</h3>"
    yield from map(folded, section.tables)
    yield f"{folded(section.every, 'folded every')}</section>"


def _file(name: str) -> str:
    return files("koopcli.reproduction").joinpath(name).read_text(encoding="utf-8")
