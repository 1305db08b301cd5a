"""The vehicles by name, and what one is called where only its parameters are known: the shipped ones that have them."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, is_dataclass
from functools import cache
from pathlib import Path

from koopcli.choices import written
from koopcli.config.data import data_folder, locate
from koopcli.vehicles.parameters import VehicleFile, VehicleParameters, read_vehicle_file

DIGITS = 4  # of the digest, in what a vehicle is called that is not shipped


@dataclass(frozen=True)
class Fingerprint:
    """Which parameters of a vehicle are known, by their ``names``, and the ``digest`` of their values."""

    names: tuple[str, ...]
    digest: str


def fingerprint(source: object, names: tuple[str, ...]) -> Fingerprint:
    """That of the parameters ``names`` of ``source``: a vehicle, or settings that hold some of one."""
    values = {name: getattr(source, name) for name in names}
    plain = {name: written(value) if is_dataclass(value) else value for name, value in values.items()}
    return Fingerprint(names, hashlib.sha256(json.dumps(plain, sort_keys=True).encode()).hexdigest())


def called(wanted: Fingerprint) -> str:
    """Every shipped vehicle that has these parameters, else "own vehicle" and the first digits of their digest."""
    return " or ".join(_alike(wanted)) or _own(wanted)


def titled(wanted: Fingerprint) -> str:
    """As :func:`called`, the vehicles by their titles."""
    return " or ".join(_alike(wanted).values()) or _own(wanted)


def vehicles() -> dict[str, VehicleFile]:
    """The shipped vehicle files by name."""
    return {path.stem: _read_once(path) for path in sorted(_folder().glob("*.toml"))}


def vehicle_named(name: str, folder: Path = Path()) -> VehicleParameters:
    """The vehicle ``name`` (shipped, or a file by its path from ``folder``)."""
    path = locate("vehicles", name, "vehicle", folder)
    return (_read_once if path.parent == _folder() else read_vehicle_file)(path).parameters


def _folder() -> Path:
    return data_folder() / "vehicles"


_read_once = cache(read_vehicle_file)  # what is shipped does not change


def _alike(wanted: Fingerprint) -> dict[str, str]:
    """The shipped vehicles that have these parameters by name, with their titles."""
    return {
        name: file.title for name, file in vehicles().items() if fingerprint(file.parameters, wanted.names) == wanted
    }


def _own(wanted: Fingerprint) -> str:
    return f"own vehicle {wanted.digest[:DIGITS]}"
