"""The first screen of a report: one sentence, four numbers, one picture, ghosts, and what is not there."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from koopcli.reproduction.ghosts import Shown
from koopcli.reproduction.illustrations import Illustration
from koopcli.reproduction.markup import figure, listed, table, text
from koopcli.reproduction.report import REDUCED, Method, Number, Race, Run, Table
from koopcli.reproduction.road import road

TITLE = "Koopman predictors of vehicle dynamics: paper and here"
MOST = 4  # numbers on the first screen
ALONE = {"edmd": "eigenfunctions", "eigen": "EDMD"}  # what a report of one method leaves out
OTHER = {"edmd": "eigen", "eigen": "edmd"}


@dataclass(frozen=True)
class Part:
    """One method of a report: its runs and pictures, and how many evaluations were ``planned`` where a run stopped."""

    method: Method
    runs: Sequence[Run]
    illustrations: Sequence[Illustration]
    planned: int | None = None

    @property
    def whole(self) -> bool:
        """Whether every evaluation is there, and what is measured of it, without which there are no tables or notes."""
        scored = sum(len(run.scored) for run in self.runs)
        return self.planned is None or (self.method.measure is None and self.planned == scored)


@dataclass(frozen=True)
class Opening:
    """The first screen; ``about``: vehicle, date and version; ``ghosts``: why there are none, where there are none."""

    sentence: str
    about: Sequence[str]
    numbers: Table
    picture: Illustration | None
    ghosts: Shown | str
    missing: Sequence[str]


def leading(methods: Sequence[Method]) -> Method:
    """The method whose race is shown: EDMD, which knows inputs, else what goes furthest."""
    return next((method for method in methods if method.name == "edmd"), methods[-1])


def race(methods: Sequence[Method], run: Run) -> Race:
    """The race of a report."""
    return leading(methods).lead.race(run.experiment)


def opening(parts: Sequence[Part], ghosts: Shown | str, version: str) -> Opening:
    """The first screen of a report of ``parts``."""
    dates = [scored.record.provenance["time"][:10] for part in parts for run in part.runs for scored in run.scored]
    clauses = "; ".join(clause for part in parts if (clause := part.method.lead.clause(part.runs[0])) is not None)
    clauses = clauses or "none of the numbers of this screen was reached"
    shown = numbers(parts)
    about = [vehicles(parts, shown), f"computed {max(dates)}" if dates else "nothing computed", version]
    picture = lead_picture([illustration for part in parts for illustration in part.illustrations])
    sentence = f"{clauses[0].upper()}{clauses[1:]}."
    return Opening(sentence, about, shown, picture, ghosts, list(missing(parts, ghosts)))


def vehicles(parts: Sequence[Part], shown: Table) -> str:
    """The experiment's vehicle, and others that the numbers ``shown`` are of."""
    cells = (scored.cell for part in parts for run in part.runs for scored in run.scored)
    others = dict.fromkeys(str(getattr(cell, "vehicle", "")) for cell in cells)
    named = [name for name in others if name and any(name in row[0] for row in shown.rows)]
    return ", ".join(dict.fromkeys([parts[0].runs[0].experiment.vehicle_name, *named]))


def numbers(parts: Sequence[Part]) -> Table:
    """The paper's numbers beside those of every run: the first of each method, and more of the first."""
    each = [part.method.lead.numbers(part.runs) for part in parts]
    rest = [numbers[0] for numbers in each[1:] if numbers]
    chosen: list[Number] = [*each[0][: max(1, MOST - len(rest))], *rest][:MOST]
    labels = list(dict.fromkeys(run.label for part in parts for run in part.runs))
    rows = []
    for number, part in zip(chosen, _owners(each, parts, chosen), strict=True):
        here = dict(zip((run.label for run in part.runs), number.here, strict=True))
        if part.whole or any(text != "–" for text in here.values()):
            rows.append([number.label, number.paper, *(here.get(label, "–") for label in labels), number.unit])
    return Table("RMSE, mean ± standard deviation", ["RMSE, mean ± deviation", "paper", *labels, ""], rows)


def _owners(each: Sequence[Sequence[Number]], parts: Sequence[Part], chosen: Sequence[Number]) -> list[Part]:
    return [next(part for numbers, part in zip(each, parts, strict=True) if number in numbers) for number in chosen]


def lead_picture(illustrations: Sequence[Illustration]) -> Illustration | None:
    """The picture of the first screen: the first drawn one that leads, else the first that is drawn."""
    drawn = [illustration for illustration in illustrations if illustration.drawing is not None]
    return next((illustration for illustration in drawn if illustration.leads), drawn[0] if drawn else None)


def missing(parts: Sequence[Part], ghosts: Shown | str) -> Iterator[str]:
    """What a reader may look for in vain."""
    names = {part.method.name for part in parts}
    if any(REDUCED in part.method.notes(part.runs) for part in parts):
        yield REDUCED
    broken = [
        f"{sum(len(run.scored) for run in part.runs)} of {part.planned} evaluations of {part.method.title}"
        for part in parts
        if not part.whole
    ]
    if broken:
        yield (
            f"The run was interrupted: {' and '.join(broken)} are here, without their tables. The same command goes on."
        )
    for name in sorted(names & set(ALONE)):
        if OTHER[name] not in names:
            yield f"This report leaves out {ALONE[name]}, which koop reproduce {OTHER[name]} adds."
    undrawn: dict[str, list[str]] = {}
    for part in parts:
        for illustration in part.illustrations:
            if illustration.drawing is None:
                undrawn.setdefault(illustration.reason, []).append(illustration.figure)
    for reason, figures in undrawn.items():
        kind = "The figure" if len(figures) == 1 else "The figures"
        yield f"{kind} {', '.join(dict.fromkeys(figures))} could not be drawn: {reason}."
    if isinstance(ghosts, str):
        yield f"There are no ghosts: {ghosts}."


def screen(shown: Opening) -> Iterator[str]:
    """The first screen as HTML."""
    yield f'<header><h1>{TITLE}</h1><div class="said"><p class="sentence">{text(shown.sentence)}</p>'
    yield f'<p class="about">{" · ".join(map(text, shown.about))}</p>'
    yield f'<div class="numbers">{table(shown.numbers)}</div>{listed(shown.missing, "missing")}</div>'
    if shown.picture is not None:
        yield from figure(shown.picture, brief=True)
    if not isinstance(shown.ghosts, str):
        yield from road(shown.ghosts)
    yield "</header>"
