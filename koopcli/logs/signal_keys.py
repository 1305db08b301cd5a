"""The keys of a signal in a map: where its column is, and what its values are multiplied with."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal, cast

from koopcli.errors import InvalidValueError
from koopcli.logs.entries import SI, Column, Signal
from koopcli.logs.units import unit
from koopcli.logs.values import checked, choice, column, listed, near, number, table, text, whole

SIGNAL = ("source", "column", "columns", "unit", "sign", "ratio", "hold", "reduce", "smooth", "from", "width", "lever")
AXES = ("x", "y", "z")


def signals_of(values: Mapping[str, Any], role: str, sources: Sequence[str]) -> tuple[Signal, ...]:
    """The signals of the table ``role``, "states" or "inputs", of a map with these ``sources``, in their order.

    Raises ``InvalidValueError`` for a key, a source or a unit that is unknown, and for a value out of range.
    """
    signals = []
    for name, entry in table(values.get(role, {}), role).items():
        where = f"{role}.{name}"
        told = {"column": entry} if isinstance(entry, (str, int)) else table(entry, where)
        signals.append(_signal(name, told, where, sources))
    return tuple(signals)


def si_of(signal: Signal) -> str:
    """The SI unit of what a signal becomes; "" where neither its name nor the map says it."""
    if signal.result in SI:
        return SI[signal.result]
    if signal.heading:
        return "rad/s"
    return unit(signal.unit, signal.name).si if signal.unit is not None else ""


def _signal(name: str, entry: Mapping[str, Any], where: str, sources: Sequence[str]) -> Signal:
    checked(entry, (*SIGNAL, "axis"), where)
    source = entry.get("source", sources[0] if len(sources) == 1 else None)
    if source not in sources:
        given = f"no source '{source}' in the map" if source is not None else "no source given"
        raise InvalidValueError(f"{where}: {given}: {near(str(source), sources)}")
    axis, sign = _axis(entry.get("axis"), where)
    heading = "from" in entry and choice(entry["from"], ("heading",), f"{where}.from") == "heading"
    _check_apart(entry, where, heading)
    sign *= number(entry.get("sign", 1), f"{where}.sign")
    if abs(sign) != 1:
        raise InvalidValueError(f"{where}.sign is {entry['sign']!r}: 1 or -1 was expected; a factor goes into ratio")
    ratio = number(entry.get("ratio", 1.0), f"{where}.ratio")
    if ratio == 0:
        raise InvalidValueError(f"{where}.ratio is 0: raw values are divided by it, another number was expected")
    held = choice(entry.get("hold", "mean"), ("mean", "last"), f"{where}.hold")
    return Signal(
        name=name,
        source=str(source),
        columns=_columns(entry, where, axis),
        unit=_unit(name, entry, where, heading),
        sign=sign,
        ratio=ratio,
        hold=cast('Literal["mean", "last"]', held),
        reduce=cast('Literal["mean", "sum"]', choice(entry.get("reduce", "mean"), ("mean", "sum"), f"{where}.reduce")),
        smooth=whole(entry.get("smooth", 1), f"{where}.smooth", 1),
        heading=heading,
        width=number(entry.get("width", Signal.width), f"{where}.width", above=0.0),
        lever=number(entry.get("lever", 0.0), f"{where}.lever"),
        axis=axis,
    )


def _check_apart(entry: Mapping[str, Any], where: str, heading: bool) -> None:
    if "width" in entry and not heading:
        raise InvalidValueError(f'{where} has width without from = "heading": it is the time of that difference')
    if "reduce" in entry and "columns" not in entry:
        raise InvalidValueError(
            f"{where} has reduce without columns: the columns that are reduced to one were expected"
        )
    if "lever" in entry and not where.endswith((".v_y", ".side_slip")):
        raise InvalidValueError(f"{where} has a lever: only v_y or side_slip depends on where its sensor is")


def _axis(axis: Any, where: str) -> tuple[int | None, float]:
    if axis is None:
        return None, 1.0
    name = choice(axis, tuple(f"{sign}{axis}" for axis in AXES for sign in ("", "-")), f"{where}.axis")
    return AXES.index(name[-1]), -1.0 if name.startswith("-") else 1.0


def _columns(entry: Mapping[str, Any], where: str, axis: int | None) -> tuple[Column, ...]:
    if "column" in entry and "columns" in entry:
        raise InvalidValueError(f"{where} has column and columns: one of them was expected")
    if "columns" in entry:
        several = tuple(column(each, f"{where}.columns") for each in listed(entry["columns"], f"{where}.columns"))
        if len(set(several)) < max(1, len(several)):
            raise InvalidValueError(f"{where}.columns is {entry['columns']!r}: different columns were expected")
        return several
    if "column" in entry:
        return (column(entry["column"], f"{where}.column"),)
    if axis is not None:
        return ()
    raise InvalidValueError(f'{where} has no column: write column = "name" or its number, counted from 0')


def _unit(name: str, entry: Mapping[str, Any], where: str, heading: bool) -> str | None:
    if "unit" not in entry:
        return None
    measured = unit(text(entry["unit"], f"{where}.unit"), f"{where}.unit")
    wanted = "rad" if heading else SI.get(name, measured.si)
    if measured.si != wanted:
        raise InvalidValueError(f"{where}.unit is '{entry['unit']}': a unit such as {wanted} was expected")
    return measured.name
