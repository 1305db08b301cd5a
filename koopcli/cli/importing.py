"""The command that brings in a log."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from koopcli.cli.invocation import begin, print_json
from koopcli.cli.options import DryRunOption, JsonOption, StoreOption
from koopcli.cli.outputs import check_outputs, write_text
from koopcli.console import Console, show_table
from koopcli.errors import InvalidValueError, UsageError

if TYPE_CHECKING:
    from koopcli.logs.check import Check
    from koopcli.stages.pipeline import Artefact

STOPS = ("warn", "ask")  # with --strict


def import_(
    files: Annotated[
        list[str],
        typer.Argument(metavar="FILE...", help="Files of the log, folders, or quoted patterns such as 'run1/*.csv'."),
    ],
    map_: Annotated[
        Path | None,
        typer.Option("--map", metavar="MAP.toml", help="Which column is which signal, in which unit, at which time."),
    ] = None,
    suggest: Annotated[
        bool, typer.Option("--suggest", help="Write a first map instead, with what was guessed and what is doubtful.")
    ] = False,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="MAP.toml", help="Where the suggested map goes; else stdout."),
    ] = None,
    strict: Annotated[
        bool, typer.Option("--strict", help="Refuse a log of which a check warns or asks, with exit code 3.")
    ] = False,
    store: StoreOption = None,
    dry_run: DryRunOption = False,
    as_json: JsonOption = False,
) -> None:
    """Bring in a log of your own car: its files and a map of them become states and inputs on one grid, in episodes.

    What was found stands on stderr: rows, episodes, and checks that catch a wrong unit, sign or clock, each with what
    mends it. Nothing is invented before the first or after the last sample of a channel, or across a gap. The artefact
    hangs on the bytes of the files and on what the map says, not on where they lie.

    Example: koop import 'run1/*.csv' --map map.toml
    """
    from koopcli.logs.files import expand

    paths = expand(files)
    check_outputs(output, None, as_json=as_json)
    if suggest:
        if map_ is not None:
            raise UsageError("--suggest writes a first map and reads none: leave out --map")
        if output is not None and output.exists():
            raise UsageError(f"{output} is there already, and may have been edited: name another file, or remove it")
        _suggest(paths, output, as_json=as_json)
        return
    if output is not None:
        raise UsageError("-o goes with --suggest, which writes a map")
    if map_ is None:
        raise UsageError("a map is needed: --map MAP.toml; koop import FILE… --suggest -o MAP.toml writes a first one")
    from koopcli.logs.map import parse_map
    from koopcli.stages.logs import imported

    task = imported(paths, parse_map(_text(map_)))
    call = begin(store, "paper", None, (), {})

    def report(artefact: Artefact) -> None:
        _show(artefact.content.checks)
        doubts = [check for check in artefact.content.checks if check.verdict in STOPS]
        if strict and doubts:
            named = ", ".join(f"{check.name}{f' of {check.signal}' if check.signal else ''}" for check in doubts)
            raise InvalidValueError(f"with --strict this log is refused: {named}; {doubts[0].hint or 'mend the map'}")

    call.run(lambda experiment: task, as_json=as_json, dry_run=dry_run, extra=report)


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InvalidValueError(f"cannot read the map {path}: {error}") from error


def _show(checks: Sequence[Check]) -> None:
    """The checks as a table on stderr, with the hints of those that are not healthy below."""
    rows = [
        [
            check.name.replace("_", " "),
            check.signal,
            check.measured,
            check.healthy,
            check.verdict,
        ]
        for check in checks
    ]
    if rows:
        show_table(["check", "signal", "value", "healthy", "verdict"], rows, left=5, file=sys.stderr)
    for check in checks:
        if check.verdict != "ok" and check.hint:
            print(f"{check.verdict}: {check.name.replace('_', ' ')}: {check.hint}", file=sys.stderr)


def _suggest(paths: Sequence[Path], output: Path | None, *, as_json: bool) -> None:
    from koopcli.logs.suggest import suggest

    suggestion = suggest(paths)
    console = Console()
    for note in suggestion.notes:
        console.note(note)
    if as_json:
        print_json({"map": suggestion.text, "notes": list(suggestion.notes)})
    elif output is None:
        print(suggestion.text, end="")
    else:
        write_text(output, suggestion.text)
        console.note(f"wrote {output}: look through it, then koop import … --map {output}")


def register(app: typer.Typer) -> None:
    """Add the command of this file."""
    app.command("import")(import_)
