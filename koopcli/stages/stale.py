"""Which artefacts today's koop would not make again under the same key, and why; and which other code has made."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from koopcli.choices import essential
from koopcli.config.changes import flat
from koopcli.errors import KoopError, NewerFormatError
from koopcli.figures import source_digest
from koopcli.stages.base import Task
from koopcli.stages.recorded import recipe_of, settings_of
from koopcli.stages.registry import STAGES
from koopcli.store import Record
from koopcli.store.code import SHORT, code_digest
from koopcli.store.identity import canonical, key_of, plain


def stale(records: Mapping[str, Record]) -> dict[str, str]:
    """full name -> why, of those among ``records`` (all of a store, by full name) that are stale."""
    judge = _Judge(records)
    return {full: why for full in records if (why := judge.why(full)) is not None}


def other_code(record: Record) -> str | None:
    """What is said of an artefact that other code made, whatever its key, or None."""
    code = record.provenance.get("code")
    if code == code_digest():
        return None
    return f"made by other code ({code[:SHORT]})" if isinstance(code, str) else "made by a koop that told no code"


class _Judge:
    """Judges each record once, its inputs first."""

    def __init__(self, records: Mapping[str, Record]) -> None:
        self._records = records
        self._judged: dict[str, str | None] = {}

    def why(self, full: str) -> str | None:
        """Why the artefact ``full`` is stale, or None."""
        if full not in self._judged:
            self._judged[full] = None
            self._judged[full] = "; ".join(self._reasons(self._records[full])) or None
        return self._judged[full]

    def _reasons(self, record: Record) -> Iterator[str]:
        stage = STAGES.get(record.stage)
        if stage is None:
            yield f"this koop has no stage {record.stage}"
            return
        own = list(_own_reasons(record, stage.version))
        yield from own
        inputs = {}
        for role, full in record.lineage.items():
            upstream = self._records.get(full)
            if upstream is None:
                yield f"its {role}, {full.partition('/')[0]}, is gone"
            elif upstream.data != record.recipe["inputs"].get(role):
                yield f"its {role} has come out different since"
            elif self.why(full) is not None:
                yield f"its {role} is stale"
            else:
                inputs[role] = upstream
        if not own and len(inputs) == len(record.lineage):
            task = Task(record.stage, settings_of(record))
            if key_of(recipe_of(task, inputs)) != record.key:
                yield "its recipe is written differently here"


def _own_reasons(record: Record, version: int) -> Iterator[str]:
    """Why an artefact is stale whatever it was made from."""
    written = record.recipe["version"]
    if written != version:
        yield f"version {written} of its stage, here {version}"
    try:
        settings = settings_of(record)
        here = dict(flat(plain(essential(settings))))
    except NewerFormatError as error:
        cause = error.__cause__
        yield f"settings that are no longer known ({cause if isinstance(cause, KoopError) else 'one is missing'})"
        return
    recorded = dict(flat(record.recipe["settings"]))
    changed = sorted(name for name in here.keys() | recorded.keys() if not _same(here, recorded, name))
    if changed:
        yield f"settings that are written differently here: {', '.join(changed)}"
    if record.stage == "plot" and settings.drawn_by != source_digest(settings.figure):
        yield "drawn by other code"


def _same(here: Mapping[str, Any], recorded: Mapping[str, Any], name: str) -> bool:
    return name in here and name in recorded and canonical(here[name]) == canonical(recorded[name])
