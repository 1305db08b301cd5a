"""The commands that look after the store: verify, gc."""

from __future__ import annotations

import math
from typing import Annotated

import typer

from koopcli.cli.invocation import open_store, print_json
from koopcli.cli.options import JsonOption, StoreOption
from koopcli.console import show_table
from koopcli.errors import DamagedArtefactError, InvalidValueError, NewerFormatError, UsageError

DAYS = 7.0


def verify(
    fast: Annotated[
        bool,
        typer.Option("--fast", help="Check only the records, and whether their objects are there in the right size."),
    ] = False,
    full: Annotated[
        bool, typer.Option("--full", help="Check every byte too, and whether each artefact opens (the default).")
    ] = False,
    mend: Annotated[
        bool, typer.Option("--repair", help="Put damaged files aside, and make again what can be made again.")
    ] = False,
    store: StoreOption = None,
    as_json: JsonOption = False,
) -> None:
    """Check the artefacts of the store for damage. Without --repair nothing is changed.

    Chunks of unfinished artefacts are checked when they are used. The exit code is 5 where something stays damaged, and
    8 where every artefact is of a format that this koop does not read.

    Example: koop verify --repair
    """
    from koopcli.stages.repair import opens, repair
    from koopcli.store.files import size_text
    from koopcli.store.verify import verify

    if fast and full:
        raise UsageError("--fast and --full exclude each other: choose one")
    console, shelf = open_store(store)
    if not as_json:
        console.note(f"store: {shelf.root}")
    with console.progress("verify") as progress:
        report = verify(shelf, None if fast else opens, progress)
    findings = repair(shelf, console, report.findings) if mend else list(report.findings)
    left = [finding for finding in findings if finding.damage and not finding.repaired]
    if as_json:
        rows = [
            {"kind": f.kind, "name": f.name, "path": f.path, "what": f.what, "damage": f.damage, "repaired": f.repaired}
            for f in findings
        ]
        counts = {"unfinished": report.unfinished, "quarantine": report.quarantine, "damaged": len(left)}
        checked = {"checked": report.checked, "other_format": report.other_format, "bytes": report.read}
        print_json({**checked, **counts, "findings": rows})
    else:
        if findings:
            table = [[f.kind, f.name, f.path, f.what, "yes" if f.repaired else ""] for f in findings]
            header = ["finding", "artefact", "file", "what", "repaired"]
            show_table(header, table, left=5)
        read = "sizes only" if fast else f"{size_text(report.read)} read"
        mended = sum(finding.repaired for finding in findings)
        state = f"{len(left)} damaged" if left else "nothing is damaged"
        others = f"; {report.other_format} of another format" if report.other_format else ""
        print(f"{report.checked} artefacts, {read}: {f'{mended} repaired, ' if mended else ''}{state}{others}")
        if report.unfinished or report.quarantine:
            console.note(f"unfinished artefacts: {report.unfinished}; files in quarantine: {report.quarantine}")
    if left:
        raise DamagedArtefactError(
            f"{len(left)} cannot be repaired: run their commands afresh, or follow what the table says"
            if mend
            else f"{len(left)} damaged: koop verify --repair puts them aside and makes again what it can"
        )
    if report.other_format and not report.checked:
        raise NewerFormatError(f"none of the {report.other_format} artefacts has the format that this koop reads")


def gc(
    delete: Annotated[
        bool, typer.Option("--delete", help="Remove them; without this option koop only says what would go.")
    ] = False,
    grace: Annotated[
        float, typer.Option(metavar="DAYS", help=f"Keep whatever is younger than this, pinned or not ({DAYS:g}).")
    ] = DAYS,
    store: StoreOption = None,
    as_json: JsonOption = False,
) -> None:
    """Remove artefacts that nobody keeps: neither pinned, nor young, nor behind any such artefact.

    What interrupted commands have left is removed too. Damaged files that were put aside stay where they are. Nobody
    else should be at work with --grace 0: what others have just made is not pinned yet.

    Example: koop gc --grace 30 --delete
    """
    from koopcli.store.collect import plan, remove
    from koopcli.store.files import DAY, size_text

    if not (math.isfinite(grace) and grace >= 0):
        raise InvalidValueError(f"--grace must be a number of days of at least 0, got {grace:g}")
    console, shelf = open_store(store)
    if not as_json:
        console.note(f"store: {shelf.root}")
    with console.progress("gc") as progress:
        planned = plan(shelf, grace * DAY, delete=delete, progress=progress)
        removals = remove(shelf, planned, progress) if delete else list(planned.removals)
    if planned.clock:
        console.warn(planned.clock)
    size = sum(removal.size for removal in removals)
    if as_json:
        rows = [{"kind": removal.kind, "name": removal.name, "bytes": removal.size} for removal in removals]
        print_json({"remove": rows, "bytes": size, "kept": planned.kept, "deleted": delete})
        return
    if removals:
        table = [[removal.name, removal.kind, size_text(removal.size)] for removal in removals]
        show_table(["removed" if delete else "would remove", "kind", "frees"], table, left=2)
    done = "removed" if delete else "to remove"
    print(f"{done}: {len(removals)} ({size_text(size)}); artefacts kept: {planned.kept}")
    if planned.there.quarantine:
        console.note(f"{len(planned.there.quarantine)} damaged files in {shelf.root / 'quarantine'} stay there")
    if removals and not delete:
        console.note("nothing was removed: koop gc --delete does it")


def register(app: typer.Typer) -> None:
    """Add the commands of this file."""
    for command in (verify, gc):
        app.command(command.__name__)(command)
