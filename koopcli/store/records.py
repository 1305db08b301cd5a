"""The record of an artefact: recipe, object and provenance as JSON people can read, guarded by its own check."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from koopcli.errors import InvalidValueError, NewerFormatError, OlderFormatError
from koopcli.parsing import TooDeepError, parse_json, parse_json_at
from koopcli.store.identity import SCHEMA, canonical, key_of
from koopcli.store.names import DIGEST, SHORT, is_name

RECIPE = re.compile(r'"recipe"\s*:\s*')


class BadRecordError(Exception):
    """A record that does not read, or does not match its own check or key."""


@dataclass(frozen=True)
class Record:
    """What is known of one artefact; writing it is what commits the artefact.

    ``recipe`` {schema, stage, version, settings, inputs: {role: data digest}} hashes to ``key``; ``lineage`` names
    the inputs as "stage/key"; ``object`` is the sha256 of the stored bytes, ``size`` their number, ``data`` the
    digest of the logical content. ``settings``: every setting, since a default that the recipe leaves out may change.
    """

    recipe: Mapping[str, Any]
    lineage: Mapping[str, str]
    object: str
    size: int
    data: str
    provenance: Mapping[str, Any]
    settings: Mapping[str, Any] = field(default_factory=dict)

    @property
    def key(self) -> str:
        """The key of the recipe."""
        return key_of(self.recipe)

    @property
    def stage(self) -> str:
        """The stage that made it."""
        return str(self.recipe["stage"])

    @property
    def name(self) -> str:
        """What commands print and take."""
        return f"{self.stage}/{self.key[:SHORT]}"

    def to_json(self) -> bytes:
        """The record as indented JSON with its check."""
        content = {"schema": SCHEMA, **vars(self)}
        return (json.dumps({**content, "check": _check(content)}, indent=1, ensure_ascii=False) + "\n").encode()

    @classmethod
    def from_json(cls, text: bytes, stage: str, key: str) -> Record:
        """The record in ``text``, verified.

        Raises ``BadRecordError`` for a damaged record and ``NewerFormatError`` for one of another schema, of which an
        older one is an ``OlderFormatError``.
        """
        try:
            content = parse_json(text)
            schema = content["schema"]
        except (ValueError, KeyError, TypeError) as error:
            raise BadRecordError from error
        if isinstance(schema, int) and schema > SCHEMA:
            raise NewerFormatError(
                f"{stage}/{key[:SHORT]} was written by a newer koop (format {schema}, this one reads {SCHEMA}): "
                "update koop or choose another --store"
            )
        try:
            check = content.pop("check")
            if check != _check(content):
                raise BadRecordError
            if content.pop("schema") != SCHEMA:
                raise OlderFormatError(
                    f"{stage}/{key[:SHORT]} was written by an older koop (format {schema}, this one reads {SCHEMA}): "
                    "make it afresh in another --store, or read it by the koop that wrote it"
                )
            record = cls(**content)
            if not _well_formed(record) or (record.stage, record.key) != (stage, key):
                raise BadRecordError
        except (ValueError, KeyError, TypeError, AttributeError, InvalidValueError) as error:
            raise BadRecordError from error
        return record


def whole_recipe(text: bytes, key: str) -> dict[str, Any] | None:
    """The recipe in the text of a damaged record, which may be cut off behind it, if it still hashes to ``key``."""
    try:
        recipe = _recipe_in(text)
        return dict(recipe) if _is_recipe(recipe) and key_of(recipe) == key else None
    except (ValueError, KeyError, TypeError, InvalidValueError):
        return None


def _recipe_in(text: bytes) -> Any:
    try:
        return parse_json(text)["recipe"]
    except TooDeepError:
        raise
    except ValueError:
        decoded = text.decode(errors="replace")  # it may be cut within a letter
        heading = RECIPE.search(decoded)
        if heading is None:
            raise
        return parse_json_at(decoded, heading.end())


def _well_formed(record: Record) -> bool:
    """Whether each entry has its form: paths are made of them."""
    return (
        all(isinstance(value, dict) for value in (record.lineage, record.provenance, record.settings))
        and all(isinstance(digest, str) and DIGEST.fullmatch(digest) for digest in (record.object, record.data))
        and type(record.size) is int
        and record.size >= 0
        and all(map(is_name, record.lineage.values()))
        and _is_recipe(record.recipe)
    )


def _is_recipe(recipe: object) -> bool:
    return (
        isinstance(recipe, dict)
        and isinstance(recipe.get("stage"), str)
        and type(recipe.get("version")) is int
        and all(isinstance(recipe.get(name), dict) for name in ("settings", "inputs"))
        and all(isinstance(digest, str) and DIGEST.fullmatch(digest) for digest in recipe["inputs"].values())
    )


def _check(content: Mapping[str, Any]) -> str:
    return hashlib.sha256(canonical(content)).hexdigest()
