"""The commands that look into the store, and what is pinned in it: ls, show, path, pin, unpin."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from koopcli.choices import written
from koopcli.cli.completion import complete_name, complete_stage
from koopcli.cli.invocation import brief, open_store, print_json, write_csv
from koopcli.cli.lineage import show_lineage
from koopcli.cli.options import JsonOption, StoreOption
from koopcli.console import Console, show_line, show_table
from koopcli.errors import NewerFormatError, OlderFormatError, UnknownNameError, UsageError

if TYPE_CHECKING:
    from koopcli.stages.base import Task
    from koopcli.stages.pipeline import Artefact
    from koopcli.store import Record, Store

NameArgument = Annotated[
    str, typer.Argument(autocompletion=complete_name, help="An artefact, by name or any unambiguous beginning of it.")
]


def ls(
    stage: Annotated[
        str | None, typer.Argument(autocompletion=complete_stage, help="List only artefacts of this stage.")
    ] = None,
    stale: Annotated[
        bool,
        typer.Option(
            "--stale",
            help="List only artefacts that this koop would not make again under the same name, and why: their stage, "
            "their settings or what they were made from have changed. Below them stand those that other code made "
            "under names that this koop gives too.",
        ),
    ] = False,
    store: StoreOption = None,
    as_json: JsonOption = False,
) -> None:
    """List the artefacts of the store, oldest first.

    Example: koop ls evaluate --stale
    """
    from koopcli.stages.registry import STAGES
    from koopcli.store.pins import pins

    if stage is not None and stage not in STAGES:
        raise UnknownNameError(f"unknown stage '{stage}' (known: {', '.join(STAGES)})")
    console, shelf = open_store(store)
    records = _records(shelf, None if stale else stage, console)
    why: dict[str, tuple[str, bool]] = {}
    if stale:
        why = _why_stale(records)
        records = [
            record for record in records if f"{record.stage}/{record.key}" in why and stage in (None, record.stage)
        ]
    labels: dict[str, list[str]] = {}
    for label, names in pins(shelf).items():
        for name in names:
            labels.setdefault(name, []).append(label)
    rows = [
        {
            "name": record.name,
            "made": _time(record),
            "seconds": _seconds(record),
            "bytes": record.size,
            "object": shelf.has_object(record),
            "pins": labels.get(f"{record.stage}/{record.key}", []),
            "settings": record.recipe["settings"],
            **(dict(zip(("why", "keeps_name"), why[f"{record.stage}/{record.key}"], strict=True)) if stale else {}),
        }
        for record in records
    ]
    if as_json:
        print_json(rows)
        return
    console.note(f"store: {shelf.root}")
    _list([row for row in rows if not row.get("keeps_name")], "why stale" if stale else "")
    if kept := [row for row in rows if row.get("keeps_name")]:
        _list(kept, "of other code", "made by other code, under the name that this koop gives it too")


def _why_stale(records: Sequence[Record]) -> dict[str, tuple[str, bool]]:
    """Full name -> why an artefact is stale, and whether it would keep its name; ``records``: all of a store."""
    from koopcli.stages import stale as staleness

    by_name = {f"{record.stage}/{record.key}": record for record in records}
    by_other_code = {
        name: (text, True) for name, record in by_name.items() if (text := staleness.other_code(record)) is not None
    }
    return by_other_code | {name: (text, False) for name, text in staleness.stale(by_name).items()}


def _list(rows: Sequence[dict[str, Any]], why: str, title: str = "") -> None:
    """The table of artefacts, with why they are listed where that has a heading."""
    from koopcli.store.files import size_text

    table = [
        [
            row["name"],
            row["made"].replace("T", " ")[:16],
            " ".join(row["pins"]),
            brief(row["settings"]),
            *([row["why"]] if why else []),
            f"{row['seconds']:.1f}",
            size_text(row["bytes"]) if row["object"] else "missing",
        ]
        for row in rows
    ]
    header = ["artefact", "made (UTC)", "pinned as", "settings", *([why] if why else []), "seconds", "size"]
    show_table(header, table, title=title, left=len(header) - 2)


def show(
    name: NameArgument,
    as_csv: Annotated[
        bool, typer.Option("--csv", help="Print the table of an evaluation or the numbers of a figure.")
    ] = False,
    lineage: Annotated[
        bool, typer.Option("--lineage", help="Show what it was made from, and that in turn, as a tree; make nothing.")
    ] = False,
    store: StoreOption = None,
    as_json: JsonOption = False,
) -> None:
    """Show an artefact: its numbers, every setting behind it, its arrays, and how it was made.

    Example: koop show evaluate/3f2a --csv > scores.csv
    """
    if as_csv and as_json:
        raise UsageError("--csv and --json are two ways to print an artefact: choose one")
    if lineage:
        if as_csv:
            raise UsageError("--csv and --lineage are two ways to show an artefact: choose one")
        show_lineage(name, store, as_json)
        return
    artefact, task, path = _obtain(name, store)
    if as_csv:
        if not hasattr(artefact.content, "table"):
            raise UnknownNameError(f"{artefact.record.name} has no table; --csv takes an evaluation or a figure")
        write_csv(artefact.content, sys.stdout)
        return
    record, packed = artefact.record, artefact.content.pack()
    full = {
        "name": record.name,
        "path": str(path),
        "figures": artefact.figures,
        "settings": dict(_settings(task, "")),
        "inputs": dict(record.lineage),
        "arrays": {
            name: {"shape": list(a.values.shape), "axes": list(a.axes), "units": a.units}
            for name, a in packed.arrays.items()
        },
        "provenance": dict(record.provenance),
    }
    if as_json:
        print_json(full)
        return
    for heading, facts in _sections(full):
        show_line(heading)
        for key, text in _rows(facts):
            show_line(f"  {key:<24} {text}")


def path(name: NameArgument, store: StoreOption = None) -> None:
    """Print where the HDF5 file of an artefact lies, after verifying it.

    Example: h5dump -n "$(koop path fit-edmd/3f2a)"
    """
    print(_obtain(name, store)[2])


def pin(name: NameArgument, store: StoreOption = None) -> None:
    """Mark an artefact to be kept.

    Example: koop pin fit-edmd/3f2a
    """
    from koopcli.store import pins

    console, shelf = open_store(store)
    record = shelf.find(name)
    pins.pin(shelf, pins.label_of(record), [record])
    console.note(f"pinned {record.name}")


def unpin(
    name: Annotated[
        str,
        typer.Argument(autocompletion=complete_name, help="An artefact by name or beginning, or the label of a pin."),
    ],
    store: StoreOption = None,
) -> None:
    """Take back a pin, of one artefact or of a reproduction.

    Example: koop unpin fit-edmd/3f2a
    """
    from koopcli.store import pins

    console, shelf = open_store(store)
    pinned = pins.pins(shelf)
    label = name if name in pinned else pins.label_of(shelf.find(name))
    pins.unpin(shelf, label)
    console.note(f"unpinned {label}")


def _records(shelf: Store, stage: str | None, console: Console) -> list[Record]:
    """The records of the store, oldest first; those of another format are counted and left out."""
    records = []
    newer = older = 0
    for made_by, key in shelf.index():
        if stage in (None, made_by):
            try:
                records.append(shelf.record(made_by, key))
            except OlderFormatError:
                older += 1
            except NewerFormatError:
                newer += 1
    if older:
        console.warn(f"not listed: {older} of an older format; make them again by the same commands")
    if newer:
        console.warn(f"not listed: {newer} of a newer format; update koop")
    return sorted((r for r in records if r is not None), key=lambda r: (_time(r), r.stage, r.key))


def _time(record: Record) -> str:
    """When an artefact was made, as far as its record says so."""
    return str(record.provenance.get("time", ""))


def _seconds(record: Record) -> float:
    """How long it took, as far as its record says so."""
    value = record.provenance.get("seconds")
    return float(value) if isinstance(value, (int, float)) else math.nan


def _obtain(name: str, store: Path | None) -> tuple[Artefact, Task, Path]:
    """The named artefact, verified, made again when damaged; its task and its path."""
    from koopcli.stages.pipeline import Pipeline

    console, shelf = open_store(store)
    pipeline = Pipeline(shelf, console)
    task = pipeline.named(name)
    artefact = pipeline.make(task)
    return artefact, task, shelf.path(artefact.record)


def _settings(task: Task, role: str) -> Iterator[tuple[str, Any]]:
    """The settings of a task and of all behind it, each under the roles that lead to it and its stage."""
    yield f"{role} ({task.stage})" if role else task.stage, written(task.settings)
    for name, upstream in task.inputs:
        yield from _settings(upstream, f"{role} / {name}".removeprefix(" / "))


def _sections(full: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Everything `show` prints, under headings."""
    yield full["name"], {"path": full["path"]}
    yield "numbers", full["figures"]
    for role, settings in full["settings"].items():
        yield f"settings of {role}", settings
    yield "inputs", full["inputs"]
    yield "arrays", full["arrays"]
    yield "provenance", full["provenance"]


def _rows(value: dict[str, Any], prefix: str = "") -> Iterator[tuple[str, str]]:
    """Nested facts as rows of dotted names and short texts."""
    for key, entry in value.items():
        name = f"{prefix}{key}"
        if isinstance(entry, dict) and "axes" in entry:
            shape = " × ".join(map(str, entry["shape"]))
            yield name, f"{shape} ({', '.join(entry['axes'])}) in {entry['units']}"
        elif isinstance(entry, dict):
            yield from _rows(entry, f"{name}.")
        elif isinstance(entry, (list, tuple)):
            yield name, " ".join(f"{value:.6g}" if isinstance(value, float) else str(value) for value in entry)
        else:
            yield name, f"{entry:.6g}" if isinstance(entry, float) else str(entry)


def register(app: typer.Typer) -> None:
    """Add the commands of this file."""
    for command in (ls, show, path, pin, unpin):
        app.command(command.__name__)(command)
