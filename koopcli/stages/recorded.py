"""What a record says and holds, by the stage that made it; and the recipe that a task will be recorded under."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from koopcli.choices import essential
from koopcli.errors import DamagedArtefactError, InvalidValueError, NewerFormatError, UsageError
from koopcli.stages.base import Stage, Task
from koopcli.stages.registry import STAGES
from koopcli.store import Record, Store
from koopcli.store.identity import SCHEMA, plain


def stage_of(record: Record) -> Stage:
    """The stage that made ``record``. Raises ``NewerFormatError`` for one that this version does not have."""
    if record.stage not in STAGES:
        raise NewerFormatError(f"{record.name} is of a stage that this koop does not have: update koop")
    return STAGES[record.stage]


def content_of(record: Record, store: Store) -> Any:
    """The verified content. Raises ``DamagedArtefactError`` when it is damaged or laid out by another version."""
    packed = store.read(record)
    try:
        return stage_of(record).unpack(packed)
    except (KeyError, TypeError, ValueError) as error:
        raise DamagedArtefactError(f"{record.name} {_other_version(record)}") from error


def settings_of(record: Record) -> Any:
    """The settings that ``record`` was made with, whatever the defaults are by now.

    Raises ``NewerFormatError`` when this version does not know them.
    """
    try:
        return stage_of(record).settings(record.settings or record.recipe["settings"])
    except (UsageError, InvalidValueError, KeyError, TypeError) as error:
        raise NewerFormatError(f"{record.name} {_other_version(record)} ({error})") from error


def all_settings(record: Record) -> dict[str, Any]:
    """Every setting of ``record`` as JSON, also those at their defaults; what it says where they are not known here."""
    try:
        settings: dict[str, Any] = plain(settings_of(record))
    except NewerFormatError:
        return dict(record.recipe["settings"])
    return settings


def _other_version(record: Record) -> str:
    written, here = record.recipe["version"], STAGES[record.stage].version
    if written == here:
        return "holds what this koop does not know: change versions, or make it afresh"
    return (
        f"was written by another koop (version {written} of its stage, here {here}): make it afresh or change versions"
    )


def recipe_of(task: Task, inputs: Mapping[str, Record]) -> dict[str, Any]:
    """The recipe of ``task`` made from ``inputs``, by role."""
    return {
        "schema": SCHEMA,
        "stage": task.stage,
        "version": STAGES[task.stage].version,
        "settings": plain(essential(task.settings)),
        "inputs": {role: record.data for role, record in inputs.items()},
    }
