"""The map of a log, read from TOML: unknown keys, sources and units are refused with those of a like name."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any, Literal, cast

from koopcli.errors import InvalidValueError
from koopcli.logs.entries import Condition, LogMap, Signal, Source, Time
from koopcli.logs.signal_keys import si_of, signals_of
from koopcli.logs.units import unit
from koopcli.logs.values import checked, choice, column, listed, near, number, table, text, whole
from koopcli.parsing import parse_toml
from koopcli.records import Meta

__all__ = ["Condition", "LogMap", "Signal", "Source", "Time", "essential_map", "parse_map"]

TOP = ("log", "vehicle", "source", "states", "inputs", "exogenous", "runs")
LOG = ("dt", "gap", "keep", "shortest", "exogenous", "runs")
SOURCE = tuple(f.name for f in fields(Source) if f.name != "name")
TIME = tuple(f.name for f in fields(Time))
CONDITION = re.compile(r"^\s*([^\s<>=]+)\s*(>=|<=|>|<)\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*?)\s*$")


def parse_map(content: str | Mapping[str, Any]) -> LogMap:
    """The map in a TOML text, or in what was read from one.

    Raises ``InvalidValueError`` for what is no TOML, an unknown key, source or unit, a value out of range, a map
    without states or without a time where it is needed, one column mapped twice, and two columns mapped to one signal.
    """
    values = _document(content)
    checked(values, TOP, "the map")
    log, vehicle = table(values.get("log", {}), "log"), table(values.get("vehicle", {}), "vehicle")
    checked(log, LOG, "log")
    checked(vehicle, ("wheelbase",), "vehicle")
    named = table(values.get("source", {}), "source") or {"log": {}}
    sources = tuple(_source(name, table(entry, f"source.{name}")) for name, entry in named.items())
    states, inputs = (signals_of(values, role, [source.name for source in sources]) for role in ("states", "inputs"))
    if not states:
        raise InvalidValueError('the map has no states: write [states] and a line such as v_x = { column = "vx" }')
    _check_signals(states + inputs)
    _check_time(sources, states + inputs)
    dt = log.get("dt", "auto")
    return LogMap(
        sources=sources,
        states=states,
        inputs=inputs,
        dt=None if dt == "auto" else number(dt, "log.dt", above=0.0),
        gap=number(log.get("gap", LogMap.gap), "log.gap", above=0.0),
        shortest=number(log.get("shortest", LogMap.shortest), "log.shortest", above=0.0),
        keep=_conditions(text(log.get("keep", ""), "log.keep"), states + inputs),
        wheelbase=number(vehicle["wheelbase"], "vehicle.wheelbase", above=0.0) if "wheelbase" in vehicle else None,
        exogenous=_exogenous(log.get("exogenous", values.get("exogenous", [])), states),
        runs=text(log.get("runs", values.get("runs", "")), "runs"),
    )


def essential_map(log_map: LogMap) -> Meta:
    """The map as plain values for a key: maps that mean the same give the same.

    What is at its default is left out, and so are sources that no signal is taken from.
    """
    sources = sorted(log_map.used, key=lambda source: source.name)
    told = _told(log_map, LogMap((), (), ()))
    told["sources"] = [{**_told(source, Source("")), "time": _told(source.time, Time())} for source in sources]
    told["states"] = [_told(signal, Signal("", "", ())) for signal in log_map.states]
    told["inputs"] = [_told(signal, Signal("", "", ())) for signal in log_map.inputs]
    told["keep"] = sorted([each.signal, each.comparison, each.value] for each in log_map.keep)
    return told


def _told(entry: Any, plain: Any) -> Meta:
    values = {f.name: getattr(entry, f.name) for f in fields(entry) if getattr(entry, f.name) != getattr(plain, f.name)}
    return {name: list(value) if isinstance(value, tuple) else value for name, value in values.items()}


def _document(content: str | Mapping[str, Any]) -> Mapping[str, Any]:
    if not isinstance(content, str):
        return content
    try:
        return parse_toml(content)
    except ValueError as error:
        raise InvalidValueError(f"the map is no TOML: {error}; a name is written once, a text in quotes") from error


def _source(name: str, entry: Mapping[str, Any]) -> Source:
    where = f"source.{name}"
    checked(entry, SOURCE, where)
    lines = {key: whole(entry[key], f"{where}.{key}", 0) for key in ("header", "units_row") if key in entry}
    texts = {key: text(entry[key], f"{where}.{key}") for key in ("file", "delimiter", "comment") if key in entry}
    if "decimal" in entry:
        texts["decimal"] = choice(entry["decimal"], (".", ","), f"{where}.decimal")
    quoted = entry.get("unquote_rows")
    if quoted not in (None, True, False):
        raise InvalidValueError(f"{where}.unquote_rows is {quoted!r}: true or false was expected")
    time = _time(table(entry.get("time", {}), f"{where}.time"), f"{where}.time")
    offset = number(entry.get("offset", 0.0), f"{where}.offset")
    return Source(name=name, time=time, offset=offset, unquote_rows=quoted, **lines, **texts)  # type: ignore[arg-type]


def _time(entry: Mapping[str, Any], where: str) -> Time:
    checked(entry, TIME, where)
    places = {key: column(entry[key], f"{where}.{key}") for key in ("column", "s", "ns") if key in entry}
    texts = {key: text(entry[key], f"{where}.{key}") for key in ("unit", "format", "file") if key in entry}
    if "unit" in texts:
        measured = unit(texts["unit"], f"{where}.unit")
        if measured.si != "s":
            raise InvalidValueError(f"{where}.unit is '{texts['unit']}': s, ms, us or ns was expected")
        texts["unit"] = measured.name
    rate = number(entry["rate"], f"{where}.rate", above=0.0) if "rate" in entry else None
    ways = [key for key in ("column", "s", "rate") if key in entry]
    alone = {"ns": "s", "format": "column"}
    for key, other in alone.items():
        if key in entry and other not in entry and not (key == "format" and not ways):
            raise InvalidValueError(f"{where} has '{key}' without '{other}': both were expected")
    if len(ways) > 1 or ("rate" in entry and len(entry) > 1) or ("format" in entry and "unit" in entry):
        raise InvalidValueError(
            f"{where} has {', '.join(entry)}: one of column + unit, column + format, s + ns, or rate was expected"
        )
    return Time(rate=rate, **places, **texts)  # type: ignore[arg-type]


def _check_signals(signals: Sequence[Signal]) -> None:
    names: dict[str, str] = {}
    places: dict[Any, str] = {}
    for signal in signals:
        if signal.result in names:
            raise InvalidValueError(
                f"two columns are mapped to {signal.result}, as {names[signal.result]} and {signal.name}: map one"
            )
        names[signal.result] = signal.name
        place = (signal.source, signal.columns, signal.axis, signal.heading)
        if place in places:
            raise InvalidValueError(f"one column is mapped as {places[place]} and as {signal.name}: map another one")
        places[place] = signal.name
    for signal in signals:
        wanted = ("v_x",) * (signal.name == "side_slip") + ("yaw_rate",) * (signal.lever != 0)
        for name in wanted:
            if name not in names:
                raise InvalidValueError(f"{signal.name} needs {name} to become v_y: map {name} too")


def _check_time(sources: Sequence[Source], signals: Sequence[Signal]) -> None:
    unsaid = {source.name for source in sources if source.time == Time()}
    for signal in signals:
        if signal.source in unsaid and 0 in signal.columns:
            raise InvalidValueError(
                f"source.{signal.source} has no time and so takes column 0, which is mapped as {signal.name}: say time "
                "= { column = ... }, { rate = ... } or { file = ... }"
            )


def _exogenous(value: Any, states: Sequence[Signal]) -> tuple[str, ...]:
    names = [signal.result for signal in states]
    chosen = {text(each, "exogenous") for each in listed(value, "exogenous")}
    for name in chosen:
        if name not in names:
            raise InvalidValueError(f"exogenous has '{name}', which is no state: {near(name, names)}")
    if len(chosen) == len(names):
        raise InvalidValueError("every state is exogenous: one that is predicted was expected, take one out")
    return tuple(name for name in names if name in chosen)


def _conditions(expression: str, signals: Sequence[Signal]) -> tuple[Condition, ...]:
    conditions = []
    known = {name: signal for signal in signals for name in (signal.name, signal.result)}
    for part in re.split(r"\band\b", expression) if expression.strip() else []:
        match = CONDITION.match(part)
        if match is None:
            raise InvalidValueError(f"log.keep has '{part.strip()}': a comparison such as v_x > 0.3 m/s was expected")
        name, comparison, value, written = match.groups()
        if name not in known:
            raise InvalidValueError(f"log.keep has '{name}', which is no signal: {near(name, list(known))}")
        wanted = si_of(known[name]) if name == known[name].result else "rad"
        measured = unit(written, "log.keep") if written else None
        if measured is not None and wanted and measured.si != wanted:
            raise InvalidValueError(f"log.keep has {name} in '{written}': a unit such as {wanted} was expected")
        factor = 1.0 if measured is None else measured.factor
        sign = cast('Literal[">", ">=", "<", "<="]', comparison)
        conditions.append(Condition(name, sign, float(value) * factor, "" if measured is None else measured.name))
    return tuple(conditions)
