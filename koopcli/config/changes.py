"""What is changed of an experiment: ``--set stage.key=value``, as nested tables and as full names."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from koopcli.checks import candidates
from koopcli.errors import InvalidValueError, UsageError
from koopcli.parsing import DEEPEST, TooDeepError, parse_toml

SECTIONS = (
    "experiment",
    "vehicle",
    "sample",
    "simulate",
    "fit-edmd",
    "fit-eigen",
    "baseline",
    "test",
    "evaluate",
    "plot",
    "reproduce",
)

NUMBER = re.compile(r"(?<![\w.+-])[+-]?(?:\d++(?:\.\d*+)?+|\.\d++)(?:[eE][+-]?\d++)?+(?![\w.])")

Values = dict[str, Any]
Changes = dict[str, Values]  # section -> setting -> raw value, or a table of them


def parse_set(assignments: Sequence[str]) -> Changes:
    """``--set stage.key=value`` as changes; the value is TOML, or plain text where it is none."""
    given = []
    for text in assignments:
        name, equals, raw = text.partition("=")
        section, *keys = name.strip().split(".")
        if not (equals and keys and all(keys)):
            raise UsageError(
                f"--set {text.strip() or repr('')}: write --set stage.key=value, such as --set vehicle.Jzz=1731"
            )
        if section not in SECTIONS:
            raise UsageError(f"--set {text}: unknown stage '{section}'{candidates(section, SECTIONS)}")
        value = toml_value(raw)
        if _is_empty(value):
            raise InvalidValueError(f"--set {text}: a table without settings changes nothing")
        given.append((name.strip(), value))
    return nested(given)


def _is_empty(value: object) -> bool:
    """Whether a value is a table without any setting, or has one in it."""
    return isinstance(value, dict) and (not value or any(map(_is_empty, value.values())))


def nested(named: Iterable[tuple[str, Any]]) -> Changes:
    """Changes from full names such as ``vehicle.lateral.mu``: the inverse of :func:`flat`."""
    changes: Changes = {}
    for name, value in named:
        section, *keys = name.split(".")
        if len(keys) > DEEPEST:
            raise UsageError(f"--set {name[:20]}…: {TooDeepError()}: name a setting, such as vehicle.Jzz")
        table = changes.setdefault(section, {})
        for key in keys[:-1]:
            if not isinstance(table.setdefault(key, {}), dict):
                table[key] = {"kind": _kind(name, key, table[key])}
            table = table[key]
        if isinstance(table.get(keys[-1]), dict):
            table[keys[-1]]["kind"] = _kind(name, keys[-1], value)
        else:
            table[keys[-1]] = value
    return changes


def _kind(name: str, key: str, value: Any) -> Any:
    """The ``value`` of a choice that has a table too: its kind. Raises ``UsageError`` for what is no choice."""
    from koopcli.config.declared import is_choice  # noqa: PLC0415  (which the names of commands do without)

    if not is_choice(key):
        raise UsageError(f"--set {name}: '{key}' is given a value of its own as well")
    return value


def flat(changes: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Every changed setting by its full name, such as ``vehicle.lateral.mu``, with its raw value.

    The kind in the table of a choice, ``fit-edmd.basis.kind``, is the choice ``fit-edmd.basis``.
    """
    for key, value in changes.items():
        if isinstance(value, Mapping):
            yield from flat(value, f"{prefix}{key}.")
        elif key == "kind" and prefix.count(".") > 1:
            yield prefix.removesuffix("."), value
        else:
            yield f"{prefix}{key}", value


def short_name(name: str) -> str:
    """The name of a setting for the kind in effect, such as ``fit-edmd.order`` of ``fit-edmd.basis.tensor.order``."""
    section, *keys = name.split(".")
    return name if section in ("vehicle", "sample", "test") else f"{section}.{keys[-1]}"


def toml_value(text: str) -> object:
    """``text`` as one TOML value, its numbers also as an option takes them (.5, 5., 007), or as it stands.

    Raises ``InvalidValueError`` for one that is nested too deep.
    """
    for written in (str, _with_toml_numbers):
        try:
            parsed = parse_toml(f"value = {written(text)}")
        except TooDeepError as error:
            raise InvalidValueError(
                f"the value {text.strip()[:20]}… is {error}: write a value that its setting takes"
            ) from error
        except ValueError:
            continue
        if len(parsed) == 1:
            return parsed["value"]
    return text.strip()


def _with_toml_numbers(text: str) -> str:
    return NUMBER.sub(_toml_number, text)


def _toml_number(number: re.Match[str]) -> str:
    text = number[0]
    return repr(int(text) if text.lstrip("+-").isdigit() else float(text))
