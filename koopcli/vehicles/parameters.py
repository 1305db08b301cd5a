"""Vehicle parameters and the TOML files that hold them, each value with its unit."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import Any

from koopcli.checks import Origin, build, candidates, from_file
from koopcli.choices import setting
from koopcli.errors import InvalidValueError
from koopcli.parsing import parse_toml
from koopcli.text import read_text


@dataclass(frozen=True)
class MagicFormula:
    """Pacejka's coefficients of one tyre in one direction (6.1)."""

    B: float = setting(above=0, high=1e6, unit="1", help="stiffness factor")
    C: float = setting(above=0, high=10, unit="1", help="shape factor")
    mu: float = setting(low=0, high=1e3, unit="1", help="peak force over load")
    E: float = setting(low=-1e3, high=1, unit="1", help="curvature factor")
    S_h: float = setting(
        0.0, low=-1, high=1, unit="1", help="shift of the slip angle of a left wheel, mirrored for a right one"
    )


@dataclass(frozen=True)
class VehicleParameters:
    """A single-track vehicle, SI units: the body with its drag, and where they are known its wheels and tyres."""

    m: float = setting(above=0, unit="kg", help="mass")
    Jzz: float = setting(above=0, unit="kg m^2", help="yaw inertia about the centre of gravity")
    l_f: float = setting(above=0, unit="m", help="distance from the centre of gravity to the front axle")
    l_r: float = setting(above=0, unit="m", help="distance from the centre of gravity to the rear axle")
    c_w: float = setting(low=0, unit="1", help="drag coefficient")
    A: float = setting(low=0, unit="m^2", help="frontal area")
    rho: float = setting(low=0, unit="kg/m^3", help="air density")
    J_R: float | None = setting(None, above=0, unit="kg m^2", help="inertia of one wheel about its axis")
    r_w: float | None = setting(None, above=0, unit="m", help="rolling radius of a wheel")
    mu_scale: float = setting(1.0, low=0, high=100, unit="1", help="grip of the road: factor on every tyre force")
    lateral: MagicFormula | None = setting(None, help="tyre forces from slip angles")
    longitudinal: MagicFormula | None = setting(None, help="tyre forces from slip ratios")
    lateral_rear: MagicFormula | None = setting(None, help="those of the rear wheels; else as in front")
    longitudinal_rear: MagicFormula | None = setting(None, help="those of the rear wheels; else as in front")

    def __post_init__(self) -> None:
        for front, rear in REAR.items():
            if getattr(self, rear) is not None and getattr(self, front) is None:
                raise InvalidValueError(f"'{rear}' stands beside '{front}', which is missing: give that of the front")
        for name in ("longitudinal", "longitudinal_rear"):
            tyre: MagicFormula | None = getattr(self, name)
            if tyre is not None and tyre.S_h != 0:
                raise InvalidValueError(
                    f"'{name}.S_h' must be 0, got {tyre.S_h:g}: a shift along the wheel would push a standing car"
                )


REAR = {"lateral": "lateral_rear", "longitudinal": "longitudinal_rear"}  # tyres in front, and behind where they differ
TYRES = tuple(f.name for f in fields(VehicleParameters) if "MagicFormula" in str(f.type))  # tables of their own
IN_PARAMETERS = {f.name: f.metadata["unit"] for f in fields(VehicleParameters) if f.name not in TYRES}


@dataclass(frozen=True)
class VehicleFile:
    """What a vehicle file holds; ``title`` and ``source`` may be missing."""

    title: str
    source: str
    parameters: VehicleParameters


def read_vehicle(path: Path) -> VehicleParameters:
    """The parameters in the vehicle file ``path``; raises as :func:`read_vehicle_file`."""
    return read_vehicle_file(path).parameters


def read_vehicle_file(path: Path) -> VehicleFile:
    """The vehicle file ``path``.

    Raises ``InvalidValueError``, naming file and key, for a file that cannot be read, a missing or unknown key,
    a value out of range, or a unit other than the SI unit of that key.
    """
    here = from_file(path)
    try:
        content = parse_toml(read_text(path))
    except tomllib.TOMLDecodeError as error:
        raise InvalidValueError(here.say(f"not valid TOML: {error}")) from error
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InvalidValueError(here.say(f"cannot read the vehicle file: {reason}")) from error
    keys = ("title", "source", "parameters", *TYRES)
    for key in content:
        if key not in keys:
            raise InvalidValueError(here.say(f"unknown key '{key}' (known: {', '.join(keys)})"))
    if "parameters" not in content:
        raise InvalidValueError(here.say("missing table '[parameters]'"))
    values = _table(content["parameters"], "parameters", IN_PARAMETERS, here)
    vehicle = build(VehicleParameters, values, here, "parameters.")
    units = {f.name: f.metadata["unit"] for f in fields(MagicFormula)}
    tyres: dict[str, object] = {
        name: build(MagicFormula, _table(content[name], name, units, here), here, f"{name}.")
        for name in TYRES
        if name in content
    }
    about = {key: content.get(key, "") for key in ("title", "source")}
    for key, text in about.items():
        if not isinstance(text, str):
            raise InvalidValueError(here.say(f"'{key}' must be a text, got {text!r}"))
    try:
        return VehicleFile(**about, parameters=build(VehicleParameters, {**vars(vehicle), **tyres}, here))
    except InvalidValueError as error:
        text = str(error)
        raise InvalidValueError(text if text.startswith(here.say("")) else here.say(text)) from error


def change(vehicle: VehicleParameters, changes: Mapping[str, object], origin: Origin) -> VehicleParameters:
    """The vehicle with single parameters replaced, those of a tyre in a table of their own.

    Errors name the ``origin`` of the changes.
    """
    merged: dict[str, object] = dict(vars(vehicle))
    for key, value in changes.items():
        current: Any = merged.get(key)
        nested = is_dataclass(current) and isinstance(value, Mapping)
        merged[key] = {**vars(current), **value} if nested else value  # type: ignore[dict-item]
    return build(VehicleParameters, merged, origin, "vehicle.")


def _table(table: object, name: str, units: Mapping[str, str], here: Origin) -> dict[str, object]:
    """The plain values of a table whose entries are each a value with its SI unit."""
    if not isinstance(table, dict):
        raise InvalidValueError(here.say(f"'{name}' must be a table '[{name}]'"))
    return {key: _si_value(key, entry, name, units, here) for key, entry in table.items()}


def _si_value(key: str, entry: object, table: str, units: Mapping[str, str], here: Origin) -> object:
    if key not in units:
        raise InvalidValueError(here.say(f"unknown key '{table}.{key}'{candidates(key, units)}"))
    if not isinstance(entry, dict) or set(entry) != {"value", "unit"}:
        wanted = f'{key} = {{ value = …, unit = "{units[key]}" }}'
        raise InvalidValueError(here.say(f"'{table}.{key}' must be written as {wanted}, got {entry!r}"))
    if entry["unit"] != units[key]:
        raise InvalidValueError(
            here.say(f"'{table}.{key}' must be given in {units[key]!r}, got unit {entry['unit']!r}")
        )
    return entry["value"]
