"""Vehicle parameters and the TOML files that hold them, each value with its unit."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path

from koopcli.checks import Origin, build, candidates, from_file, setting
from koopcli.errors import InvalidValueError


@dataclass(frozen=True)
class VehicleParameters:
    """Rigid-body and drag parameters of a single-track vehicle, SI units."""

    m: float = setting(above=0, unit="kg", help="mass")
    Jzz: float = setting(above=0, unit="kg m^2", help="yaw inertia about the centre of gravity")
    l_f: float = setting(above=0, unit="m", help="distance from the centre of gravity to the front axle")
    l_r: float = setting(above=0, unit="m", help="distance from the centre of gravity to the rear axle")
    c_w: float = setting(low=0, unit="1", help="drag coefficient")
    A: float = setting(low=0, unit="m^2", help="frontal area")
    rho: float = setting(low=0, unit="kg/m^3", help="air density")


def read_vehicle(path: Path) -> VehicleParameters:
    """The parameters in the vehicle file ``path``.

    Raises ``InvalidValueError``, naming file and key, for a file that cannot be read, a missing or unknown key,
    a value out of range, or a unit other than the SI unit of that key.
    """
    here = from_file(path)
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except tomllib.TOMLDecodeError as error:
        raise InvalidValueError(here.say(f"not valid TOML: {error}")) from error
    except (OSError, ValueError, RecursionError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InvalidValueError(here.say(f"cannot read the vehicle file: {reason}")) from error
    for key in content:
        if key not in ("title", "source", "parameters"):
            raise InvalidValueError(here.say(f"unknown key '{key}' (known: title, source, parameters)"))
    table = content.get("parameters")
    if not isinstance(table, dict):
        raise InvalidValueError(here.say("missing table '[parameters]'"))
    file_values = {key: _si_value(key, entry, here) for key, entry in table.items()}
    return build(VehicleParameters, file_values, here, "parameters.")


def change(vehicle: VehicleParameters, changes: Mapping[str, object], origin: Origin) -> VehicleParameters:
    """The vehicle with single parameters replaced; errors name the ``origin`` of the changes."""
    return build(VehicleParameters, {**vars(vehicle), **changes}, origin, "vehicle.")


def _si_value(key: str, entry: object, here: Origin) -> object:
    units = {f.name: f.metadata["unit"] for f in fields(VehicleParameters)}
    if key not in units:
        raise InvalidValueError(here.say(f"unknown key 'parameters.{key}'{candidates(key, units)}"))
    if not isinstance(entry, dict) or set(entry) != {"value", "unit"}:
        wanted = f'{key} = {{ value = …, unit = "{units[key]}" }}'
        raise InvalidValueError(here.say(f"'parameters.{key}' must be written as {wanted}, got {entry!r}"))
    if entry["unit"] != units[key]:
        raise InvalidValueError(
            here.say(f"'parameters.{key}' must be given in {units[key]!r}, got unit {entry['unit']!r}")
        )
    return entry["value"]
