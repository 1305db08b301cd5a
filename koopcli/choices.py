"""Declared settings, and choices among kinds with settings of their own."""

from __future__ import annotations

import types
from collections.abc import Callable, Sequence
from dataclasses import MISSING, Field, field, fields, is_dataclass
from functools import cache
from importlib import import_module
from pkgutil import iter_modules
from typing import Any, ClassVar, Self, TypeVar, Union, get_args, get_origin, get_type_hints

R = TypeVar("R")
Values = dict[str, Any]
SEED_LIMIT = 2**63 - 1


def setting(
    default: Any = MISSING,
    *,
    help: str = "",
    low: float | None = None,
    above: float | None = None,
    high: float | None = None,
    unit: str = "",
    unique: bool = False,
    empty: bool = False,
    option: bool = False,
) -> Any:
    """A dataclass field with its documentation and bounds: ``low <= value``, ``above < value``, ``value <= high``.

    ``unique``: a list without repetition; ``empty``: a list that may have no entry; ``option``: the command of these
    settings has an option for it. The default of a choice is a kind with its own defaults.
    """
    if isinstance(default, Choice) and default != type(default)():
        raise TypeError(f"the default {default} is not a kind with its own defaults")
    meta = {"help": help, "low": low, "above": above, "high": high, "unit": unit, "unique": unique, "empty": empty}
    meta["option"] = option
    return field(metadata=meta) if default is MISSING else field(default=default, metadata=meta)


def taken_from(section: str) -> Any:
    """A dataclass field that is no setting: its value is taken from another ``section`` of an experiment."""
    return field(metadata={"section": section})


class Choice:
    """One of several kinds, each with settings of its own: a base class for the choice, a frozen dataclass for a kind.

    The settings of a kind are declared by the class that uses them. They are named without it: ``order`` stands beside
    ``basis`` and holds for the kinds that have it. The first line of a kind's docstring says in its help what it is.
    ``afresh``: whether a change of the kind leaves behind what was set for the kind before, where one name means
    different things in two kinds.
    """

    kind: ClassVar[str]
    afresh: ClassVar[bool] = False

    def __init_subclass__(cls) -> None:
        for name in vars(cls).get("__annotations__", {}):
            if any(callable(getattr(base, name, None)) for base in cls.__mro__[1:]):
                raise TypeError(f"no setting of {cls.__name__} can be called '{name}': that is a method of its kind")

    @classmethod
    def kinds(cls) -> dict[str, type[Self]]:
        """The kinds by name, in the order in which they were declared."""
        named: dict[str, type[Self]] = {}
        for sub in cls.__subclasses__():
            named |= ({sub.kind: sub} if "kind" in vars(sub) else {}) | sub.kinds()
        return named


def import_files(package: str, folder: Sequence[str]) -> None:
    """Import every file of the ``folder`` of a ``package``, which makes the kinds in them known."""
    for file in iter_modules(folder):
        import_module(f"{package}.{file.name}")


def _once(of: Callable[[type], R]) -> Callable[[type], R]:
    """What is worked out ``of`` a class once: an experiment is built of thousands of settings."""
    return cache(of)


@_once
def fields_of(cls: type) -> tuple[Field[Any], ...]:
    """The fields of a settings class."""
    return fields(cls)


@_once
def hints_of(cls: type) -> dict[str, Any]:
    """The types of the fields of ``cls``."""
    return get_type_hints(cls)


@_once
def taken(cls: type) -> dict[str, str]:
    """The fields of a settings class that are no settings, each with the section that it is taken from."""
    return {f.name: f.metadata["section"] for f in fields_of(cls) if "section" in f.metadata}


@_once
def choices(cls: type) -> dict[str, type[Choice]]:
    """The settings of a class that are choices, each with its base class."""
    bare = {name: without_none(hint) for name, hint in hints_of(cls).items()}
    return {name: hint for name, hint in bare.items() if isinstance(hint, type) and issubclass(hint, Choice)}


@_once
def names_of(cls: type) -> tuple[str, ...]:
    """The settings of ``cls`` and of all kinds that it can choose."""
    own = [f.name for f in fields_of(cls) if "help" in f.metadata]
    of_kinds = [name for base in choices(cls).values() for kind in base.kinds().values() for name in names_of(kind)]
    return tuple(dict.fromkeys([*own, *of_kinds]))


def written(settings: Any) -> Values:
    """Settings as plain values by their names: a choice by its kind, with the settings of that kind beside it."""
    values: Values = {"kind": settings.kind} if isinstance(settings, Choice) else {}
    for f in fields_of(type(settings)):
        value = getattr(settings, f.name)
        if isinstance(value, Choice):
            own = written(value)
            values |= {f.name: own.pop("kind"), **own}
        else:
            values[f.name] = _written(value)
    return values


def essential(settings: Any) -> Values:
    """Settings by which a result is known: what is not at its default, and what is taken from other sections.

    What is added later with a default changes nothing here. The inverse is ``koopcli.checks.restored``.
    """
    values: Values = {"kind": settings.kind} if isinstance(settings, Choice) else {}
    for f in fields_of(type(settings)):
        value = getattr(settings, f.name)
        if isinstance(value, Choice):
            own = essential(value)
            kind = own.pop("kind")
            values |= {**({} if kind == getattr(f.default, "kind", None) else {f.name: kind}), **own}
        elif value != f.default:
            values[f.name] = _essential(value)
    return values


def _essential(value: Any) -> Any:
    if is_dataclass(value):
        return essential(value)
    return tuple(map(_essential, value)) if isinstance(value, (list, tuple)) else value


def told(settings: Any) -> Values:
    """As :func:`written`, the settings alone that are not at their defaults."""
    values: Values = {}
    for f in fields_of(type(settings)):
        value = getattr(settings, f.name)
        if isinstance(value, Choice):
            values |= ({} if value.kind == getattr(f.default, "kind", "") else {f.name: value.kind}) | told(value)
        elif value != f.default and f.name not in taken(type(settings)):
            values[f.name] = value
    return values


def _written(value: Any) -> Any:
    if is_dataclass(value):
        return written(value)
    return tuple(map(_written, value)) if isinstance(value, (list, tuple)) else value


def without_none(hint: Any) -> Any:
    """The type of a setting where it has a value."""
    if get_origin(hint) not in (Union, types.UnionType):
        return hint
    (inner,) = [part for part in get_args(hint) if part is not type(None)]
    return inner
