"""Mend a store: put damaged files aside, and make again what is lost where its recipe is known."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from koopcli.errors import (
    DamagedArtefactError,
    InvalidValueError,
    KoopError,
    NewerFormatError,
    UnknownNameError,
    UsageError,
)
from koopcli.records import Packed
from koopcli.stages.base import Reporter, Task
from koopcli.stages.pipeline import Pipeline
from koopcli.stages.recorded import recipe_of, settings_of
from koopcli.stages.registry import STAGES
from koopcli.store import Record, Store
from koopcli.store.digests import named
from koopcli.store.files import UntrustedFileError, open_regular, read_small
from koopcli.store.identity import key_of
from koopcli.store.records import whole_recipe
from koopcli.store.survey import look, records
from koopcli.store.verify import Finding

DIGESTS = ("damaged digests", "missing digests")  # kinds of findings
# Others, such as a full disk, concern more than one artefact.
HOPELESS = (DamagedArtefactError, NewerFormatError, InvalidValueError, UnknownNameError, UsageError)


def opens(record: Record, packed: Packed) -> tuple[str, str] | None:
    """What keeps the content of ``record`` from being unpacked by its stage: a kind of finding and why, or None."""
    stage = STAGES.get(record.stage)
    if stage is None:
        return "newer format", "of a stage that this koop does not have: update koop"
    try:
        stage.unpack(packed)
    except (KeyError, TypeError, ValueError, KoopError) as error:
        written, here = record.recipe["version"], stage.version
        if written != here:
            return "other version", f"laid out by version {written} of its stage, here {here}: make it afresh"
        if not _known(record):
            return "newer format", "made with settings that this koop does not know: update koop"
        return "damaged object", f"does not unpack ({' '.join(str(error).split())[:80]})"
    return None


def _known(record: Record) -> bool:
    """Whether this koop has the settings of ``record``, the kinds among them too."""
    try:
        settings_of(record)
    except NewerFormatError:
        return False
    return True


def repair(store: Store, reporter: Reporter, findings: Sequence[Finding]) -> list[Finding]:
    """Repair what can be; returns the findings, each saying whether it was.

    Digests of the slabs of a large object whose bytes are right are written anew; otherwise it is made again.
    A damaged record whose recipe still hashes to its name is made again too. A damaged pin stays: without it, what it
    kept would look like something nobody wants.
    """
    lost = _put_aside(store, findings)
    pipeline = Pipeline(store, reporter)
    done = _make_lost(pipeline, lost)
    restored = {
        finding for finding in findings if finding.kind in DIGESTS and store.restore_digests(Path(finding.path).stem)
    }
    again = ("damaged object", "missing object", *DIGESTS)
    done |= {
        finding.artefact
        for finding in findings
        if finding.kind in again and finding not in restored and finding.artefact and _make(pipeline, finding.artefact)
    }
    mended = {finding for finding in findings if finding.artefact in done and finding.damage}
    mended |= restored
    mended |= {finding for finding in findings if finding.kind == "damaged object" and not finding.artefact}
    return [replace(finding, repaired=finding in mended) for finding in findings]


@dataclass(frozen=True, eq=False)
class _Lost:
    """An artefact whose record is damaged but for its recipe."""

    full: str
    recipe: dict[str, Any]


def _put_aside(store: Store, findings: Sequence[Finding]) -> list[_Lost]:
    """Move damaged files away; returns the recipes in damaged records that are still what their names say.

    A record that was put aside before, as by a command that met it or a repair that was cut off, is as good.
    """
    lost: dict[str, _Lost] = {}
    for finding in findings:
        file = store.root / finding.path
        damaged = finding.kind in ("damaged record", "damaged object") and _still_damaged(file)
        if finding.kind == "record put aside" or (finding.kind == "damaged record" and damaged):
            recipe = _recipe(file, finding.artefact)
            if recipe is not None:
                lost[finding.artefact] = _Lost(finding.artefact, recipe)
        if damaged:
            store.put_aside(file)
    return list(lost.values())


def _still_damaged(path: Path) -> bool:
    """Whether another process has not mended a file since it was found; nor is one whose bytes are right put aside."""
    if not os.path.lexists(path):
        return False
    if path.suffix == ".json":
        recorded = look(path, path.parent.name, path.stem)
        return recorded is not None and recorded.damaged
    try:
        with open_regular(path) as (file, _):
            return named(file)[0] != path.stem
    except FileNotFoundError:
        return False
    except (OSError, UntrustedFileError):
        return True


def _recipe(path: Path, full: str) -> dict[str, Any] | None:
    """The recipe in the damaged record of ``full``, if it is one of that name and of a stage known here."""
    stage, _, key = full.partition("/")
    try:
        recipe = whole_recipe(read_small(path), key)
    except (OSError, UntrustedFileError):
        return None
    return recipe if recipe is not None and recipe["stage"] == stage and stage in STAGES else None


def _make_lost(pipeline: Pipeline, lost: Sequence[_Lost]) -> set[str]:
    """Make what has lost its record, as soon as all that it is made from is there; returns what was made."""
    done: set[_Lost] = set()
    while True:
        present = (recorded.record for recorded in records(pipeline.store.root).values()) if set(lost) - done else ()
        by_data = {record.data: record for record in present if record is not None}
        made = {artefact for artefact in lost if artefact not in done and _make_from(pipeline, artefact, by_data)}
        done |= made
        if not made:
            return {artefact.full for artefact in done}


def _make_from(pipeline: Pipeline, lost: _Lost, by_data: dict[str, Record]) -> bool:
    inputs = {role: by_data.get(data) for role, data in lost.recipe["inputs"].items()}
    present = {role: record for role, record in inputs.items() if record is not None}
    if len(present) < len(inputs):
        return False
    try:
        settings = STAGES[lost.recipe["stage"]].settings(lost.recipe["settings"])
        named = tuple((role, pipeline.named(f"{record.stage}/{record.key}")) for role, record in present.items())
        task = Task(lost.recipe["stage"], settings, named)
        if f"{task.stage}/{key_of(recipe_of(task, present))}" != lost.full:  # another version made it
            return False
        made = pipeline.make(task).record
    except (*HOPELESS, KeyError, TypeError) as error:
        pipeline.reporter.warn(str(error))
        return False
    return f"{made.stage}/{made.key}" == lost.full


def _make(pipeline: Pipeline, full: str) -> bool:
    try:
        pipeline.make(pipeline.named(full))
    except HOPELESS as error:
        pipeline.reporter.warn(str(error))
        return False
    return True
