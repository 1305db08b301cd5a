"""The one place that turns raw values into declared settings: typed, bounded, each error with its origin."""

from __future__ import annotations

import math
import sys
import types
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import MISSING, dataclass, is_dataclass
from difflib import get_close_matches
from functools import cache
from typing import Any, Literal, NoReturn, Self, TypeVar, Union, get_args, get_origin

from koopcli.choices import (
    Choice,
    Values,
    choices,
    fields_of,
    hints_of,
    names_of,
    taken,
    told,
    without_none,
    written,
)
from koopcli.errors import InvalidValueError, KoopError, MisplacedError, UsageError

T = TypeVar("T")


@dataclass(frozen=True)
class Origin:
    """Where a raw value came from: what an error message names, and what a wrong name costs."""

    label: str = ""
    misnamed: type[KoopError] = UsageError

    def say(self, text: str) -> str:
        """``text`` with the origin in front."""
        return f"{self.label}: {text}" if self.label else text


COMMAND_LINE = Origin()


def from_file(path: object) -> Origin:
    """The origin of values read from a user's file."""
    return Origin(str(path), InvalidValueError)


@dataclass(frozen=True)
class Layer:
    """Raw values of settings by their names, and where they came from."""

    values: Mapping[str, Any]
    origin: Origin = COMMAND_LINE

    def only(self, belongs: Callable[[str, object], bool]) -> Layer:
        """Those of the values that belong, by name and value."""
        return Layer({key: value for key, value in self.values.items() if belongs(key, value)}, self.origin)


class Settings:
    """Settings with choices, made and changed by the names that people write."""

    @classmethod
    def of(cls, **values: object) -> Self:
        """Those with other ``values`` than the defaults, such as ``basis="total", order=5``; raises as ``build``."""
        return build(cls, values)

    def but(self, **values: object) -> Self:
        """These with other ``values``; a kind that is changed keeps what is not at its default and both kinds have."""
        return build_layers(type(self), [Layer(told(self)), Layer(values)])


def restored(cls: type[T], values: Mapping[str, Any]) -> T:
    """The inverse of :func:`written`; ``cls`` may be the base of a choice. Raises as :func:`build`."""
    rest = dict(values)
    if issubclass(cls, Choice):
        cls = cls.kinds()[rest.pop("kind")]
    hints = hints_of(cls)
    beside = {name: coerce(hints[name], rest.pop(name), name, {}, COMMAND_LINE) for name in taken(cls) if name in rest}
    return build_layers(cls, [Layer(rest)], beside=beside)


def build(cls: type[T], values: Mapping[str, object], origin: Origin = COMMAND_LINE, prefix: str = "") -> T:
    """An instance of the settings class ``cls`` from raw ``values``, each coerced to its declared type.

    Raises ``origin.misnamed`` for a key or an enumerated value that does not exist and ``InvalidValueError``
    for a missing key, a wrong type, a value out of bounds, nan or inf.
    """
    return build_layers(cls, [Layer(values, origin)], prefix)


def build_layers(cls: type[T], layers: Sequence[Layer], prefix: str = "", beside: Mapping[str, Any] | None = None) -> T:
    """As :func:`build`, from ``layers`` of which later ones win. ``beside`` them stand values of what is no setting."""
    values = {**_checked(cls, layers, prefix), **(beside or {})}
    for f in fields_of(cls):
        if f.name not in values and f.default is MISSING and f.default_factory is MISSING:
            raise InvalidValueError(layers[-1].origin.say(f"missing key '{prefix}{f.name}'"))
    return cls(**values)


def chosen_kind(kinds: Mapping[str, type[Choice]], layers: Sequence[Layer], usual: str | None) -> str:
    """The kind that the last of the ``layers`` names, else the ``usual`` one."""
    named = [str(layer.values["kind"]) for layer in layers if "kind" in layer.values]
    return named[-1] if named else str(usual)


def choose(
    kinds: Mapping[str, type[Choice]],
    layers: Sequence[Layer],
    usual: str | None,
    prefix: str,
    what: str,
    beside: Mapping[str, Any] | None = None,
    table: str = "",
) -> Any:
    """The choice of one of ``kinds``, the ``usual`` one unless a layer names another, with its settings.

    A layer may have the name of a ``kind``, a table for a kind, in effect or not, and settings without a table, which
    hold for the kinds that have them. ``what``: the name of the choice, for messages; ``table``: where the tables of
    kinds stand within the ``prefix`` of names. Raises as :func:`build`, and for a setting that the kind in effect in
    its layer does not have.
    """
    check_choice(kinds, layers, usual, prefix, what, table)
    kind = chosen_kind(kinds, layers, usual)
    first, before = 0, usual
    for i, layer in enumerate(layers):
        now = layer.values.get("kind", before)
        if now != before and kinds[kind].afresh:
            first = i
        before = now
    own = []
    for i, layer in enumerate(layers):
        of_kind = layer.values[kind] if _is_table(kind, layer.values.get(kind), kinds) else {}
        known = names_of(kinds[kind]) if i >= first else ()
        beside_it = layer.only(lambda key, value: key in known and not _is_table(key, value, kinds))  # noqa: B023
        own.append(_together(of_kind, beside_it, prefix, f"{prefix}{table}{kind}"))
    return build_layers(kinds[kind], own, prefix, {name: (beside or {})[name] for name in taken(kinds[kind])})


def _together(table: Mapping[str, Any], beside: Layer, prefix: str, where: str) -> Layer:
    """The settings of a ``table`` that stands at ``where`` and of those ``beside`` it. Refuses one that is in both."""
    values = dict(table)
    for key, value in beside.values.items():
        one, other = values.get(key, {}), value
        if isinstance(one, Mapping) or isinstance(other, Mapping):
            one, other = (part if isinstance(part, Mapping) else {"kind": part} for part in (one, other))
            values[key] = _together(one, Layer(other, beside.origin), prefix, f"{where}.{key}").values if one else value
        else:
            raise beside.origin.misnamed(
                beside.origin.say(f"'{prefix}{key}' is set twice, as such and in the table '{where}': leave one out")
            )
    return Layer(values, beside.origin)


def check_choice(
    kinds: Mapping[str, type[Choice]],
    layers: Sequence[Layer],
    usual: str | None,
    prefix: str,
    what: str,
    table: str = "",
) -> None:
    """Refuse what no kind would take, whichever is in effect in the end, and what the kind of its layer does not have.

    ``usual``: None where it is not known yet.
    """
    kind, alike = usual, list[Layer]()
    for layer in layers:
        before, kind = kind, layer.values.get("kind", kind)
        tables = [key for key, value in layer.values.items() if isinstance(value, Mapping) and not _any_has(kinds, key)]
        for name in [*([] if kind is None else [kind]), *tables]:
            if not isinstance(name, str) or name not in kinds:
                where, tail = f"{prefix}{table}".rstrip("."), candidates(str(name), kinds)
                raise layer.origin.misnamed(layer.origin.say(f"'{where}' has no kind {_short(repr(name))}{tail}"))
        for key, value in layer.values.items():
            if _is_table(key, value, kinds):
                for name in value:
                    _check_owner(kinds, key, name, layer.origin, f"{prefix}{table}{key}.", what)
                _checked(kinds[key], [Layer(value, layer.origin)], f"{prefix}{table}{key}.")
            elif key in kinds and not any(key in names_of(cls) for cls in kinds.values()):
                raise InvalidValueError(layer.origin.say(_no_table(f"{prefix}{table}{key}", value)))
            elif kind is None:
                _check_any(kinds, Layer({key: value}, layer.origin), prefix)
            elif key != "kind":
                _check_owner(kinds, kind, key, layer.origin, prefix, what)
        if kind is not None:
            loose = layer.only(lambda key, value: key != "kind" and not _is_table(key, value, kinds))
            alike = [*(alike if kind == before else []), loose]
            _checked(kinds[kind], alike, prefix)


def _check_any(kinds: Mapping[str, type[Choice]], layer: Layer, prefix: str) -> None:
    """Refuse a setting that none of the kinds takes, where it is not known which one is in effect."""
    (key,) = layer.values
    every = [name for cls in kinds.values() for name in (*names_of(cls), *taken(cls))]
    if key != "kind" and key not in every:
        _refuse_unknown(key, dict.fromkeys(name for cls in kinds.values() for name in names_of(cls)), layer, prefix)
    refused = []
    for cls in [cls for cls in kinds.values() if key in names_of(cls)] or kinds.values():
        try:
            _checked(cls, [layer], prefix)
        except KoopError as error:
            refused.append(error)
        else:
            return
    raise max(refused, key=lambda error: isinstance(error, InvalidValueError))


def _check_owner(
    kinds: Mapping[str, type[Choice]], kind: str, key: str, origin: Origin, prefix: str, what: str
) -> None:
    """Refuse a setting of other kinds than the ``kind`` at hand."""
    owners = [name for name, cls in kinds.items() if key in names_of(cls)]
    if owners and kind not in owners:
        whose = " or ".join(f"'{owner}'" for owner in owners)
        this = f"these {what} are" if what in ("eigenvalues", "terms") else f"this {what} is"
        text = origin.say(f"'{prefix}{key}' belongs to {what} {whose}, and {this} '{kind}'")
        raise MisplacedError(text, f"{prefix}{key}") if origin.misnamed is UsageError else origin.misnamed(text)


def _any_has(kinds: Mapping[str, type[Choice]], key: str) -> bool:
    return any(key in names_of(cls) for cls in kinds.values()) and key not in kinds


def _is_table(key: str, value: object, kinds: Mapping[str, Any]) -> bool:
    return isinstance(value, Mapping) and key in kinds


def _checked(cls: type, layers: Sequence[Layer], prefix: str) -> Values:
    """The values of those settings of ``cls`` that ``layers`` give, each coerced to its declared type."""
    for layer in layers:
        for key in layer.values:
            if key in taken(cls):
                raise layer.origin.misnamed(layer.origin.say(_elsewhere(f"{prefix}{key}", key, taken(cls)[key])))
            if key not in _own(cls) and key not in names_of(cls):
                _refuse_unknown(key, names_of(cls), layer, prefix)
    values: Values = {}
    for f in fields_of(cls):
        if f.name in choices(cls):
            values |= _checked_choice(cls, f.name, layers, prefix)
            continue
        for layer in layers:
            if f.name in layer.values:
                value, hint = layer.values[f.name], hints_of(cls)[f.name]
                values[f.name] = coerce(hint, value, f"{prefix}{f.name}", f.metadata, layer.origin)
    return values


def _checked_choice(cls: type, name: str, layers: Sequence[Layer], prefix: str) -> Values:
    """The choice ``name`` of ``cls``, whose settings stand beside it or in a table of its own."""
    kinds, default = choices(cls)[name].kinds(), cls.__dataclass_fields__[name].default  # type: ignore[attr-defined]
    of_kinds = {key for kind in kinds.values() for key in names_of(kind)}
    own = []
    for layer in layers:
        table = _table_of(layer.values.get(name), choices(cls)[name])
        beside = layer.only(lambda key, value: key in of_kinds and key not in _own(cls))
        own.append(_together(table, beside, prefix, f"{prefix}{name}"))
    if default is None and not any("kind" in layer.values for layer in own):
        check_choice(kinds, own, None, prefix, name, f"{name}.")
        return {}
    return {name: choose(kinds, own, getattr(default, "kind", None), prefix, name, table=f"{name}.")}


def _table_of(given: Any, base: type[Choice]) -> Mapping[str, Any]:
    """The table of a choice, which may be given by the name of its kind or as an instance."""
    if isinstance(given, base):
        values = written(given)
        return {"kind": values.pop("kind"), given.kind: values}
    return given if isinstance(given, Mapping) else {} if given is None else {"kind": given}


def _refuse_unknown(key: str, known: Iterable[str], layer: Layer, prefix: str) -> NoReturn:
    raise layer.origin.misnamed(layer.origin.say(f"unknown setting '{prefix}{key}'{candidates(key, known)}"))


@cache
def _own(cls: type) -> set[str]:
    return {f.name for f in fields_of(cls)}


def _elsewhere(name: str, key: str, section: str) -> str:
    """What is said of a value that is taken from another section."""
    remedy = f"choose it by {key}.name" if key == "vehicle" else f"set {section}.{key}"
    return f"'{name}' is {'the vehicle' if 'vehicle' in (key, section) else 'the simulation'}'s: {remedy}"


def coerce(kind: Any, value: object, name: str, bounds: Mapping[str, Any], origin: Origin) -> object:
    """``value`` as the declared type ``kind``, so that 1 and 1.0 are one setting; bounds checked."""
    if isinstance(kind, type) and is_dataclass(kind):
        if isinstance(value, Mapping):
            return build(kind, value, origin, f"{name}.")
        if type(value) is kind:
            return value
        raise InvalidValueError(origin.say(_no_table(name, value)))
    if get_origin(kind) is Literal:
        return _choice(get_args(kind), value, name, origin)
    if get_origin(kind) in (Union, types.UnionType):
        return None if value is None else coerce(without_none(kind), value, name, bounds, origin)
    if get_origin(kind) is tuple:
        inner = get_args(kind)[0]
        if isinstance(value, str) and get_origin(inner) is Literal:
            value = (value,)  # one name, as an option gives it
        listed = isinstance(value, (list, tuple)) and (len(value) > 0 or bounds.get("empty"))
        if not listed or not isinstance(value, (list, tuple)):
            raise InvalidValueError(
                origin.say(f"'{name}' must be a non-empty list such as [1, 2], got {_short(repr(value))}")
            )
        values = tuple(coerce(inner, v, f"{name}[{i}]", bounds, origin) for i, v in enumerate(value))
        if bounds.get("unique") and len(set(values)) < len(values):
            raise InvalidValueError(origin.say(f"'{name}' names a value twice: {_short(repr(value))}"))
        return values
    number = _number(kind, value, name, origin)
    _within(number, name, bounds, origin)
    return number


def candidates(name: str, known: Any) -> str:
    """The tail of an error message that lists what would have been right, the nearest first."""
    names = [str(k) for k in known]
    near = get_close_matches(name, names, n=1, cutoff=0.5)
    listed = ", ".join(names) if names else "none"
    return f": did you mean '{near[0]}'? (known: {listed})" if near else f" (known: {listed})"


def _choice(allowed: tuple[Any, ...], value: object, name: str, origin: Origin) -> object:
    if not isinstance(value, str) or value not in allowed:
        raise origin.misnamed(
            origin.say(f"'{name}' cannot be {_short(repr(value))}; choose one of {', '.join(map(str, allowed))}")
        )
    return value


def _number(kind: Any, value: object, name: str, origin: Origin) -> Any:
    wanted = {int: "a whole number", float: "a number", str: "a text", bool: "true or false"}[kind]
    wrong = InvalidValueError(origin.say(f"'{name}' must be {wanted}, got {_short(repr(value))}"))
    if isinstance(value, bool) != (kind is bool):
        raise wrong
    if kind is int and isinstance(value, float) and value.is_integer():
        return int(value)
    if kind is float and isinstance(value, int):
        return float(value) if abs(value) < sys.float_info.max else math.inf
    if not isinstance(value, kind):
        raise wrong
    return value


def _no_table(name: str, value: object) -> str:
    return f"'{name}' must be a table of settings, got {_short(repr(value))}"


def _short(text: str) -> str:
    return text if len(text) <= 60 else f"{text[:57]}..."


def _within(value: Any, name: str, bounds: Mapping[str, Any], origin: Origin) -> None:
    if isinstance(value, str):
        return
    unit = f" {bounds['unit']}" if bounds.get("unit") not in (None, "", "1") else ""
    shown = f"{value:.6g}" if isinstance(value, float) else _short(str(value))
    if isinstance(value, float) and not math.isfinite(value):
        raise InvalidValueError(origin.say(f"'{name}' must be a finite number, got {shown}"))
    low, above, high = bounds.get("low"), bounds.get("above"), bounds.get("high")
    if low is not None and value < low:
        raise InvalidValueError(origin.say(f"'{name}' must be at least {low:g}{unit}, got {shown}"))
    if above is not None and value <= above:
        raise InvalidValueError(origin.say(f"'{name}' must be above {above:g}{unit}, got {shown}"))
    if high is not None and value > high:
        raise InvalidValueError(origin.say(f"'{name}' must be at most {high:g}{unit}, got {shown}"))
