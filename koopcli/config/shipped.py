"""What a vehicle is called where only its parameters are known: the shipped vehicles that have them."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, is_dataclass

from koopcli.choices import written
from koopcli.config.data import data_folder
from koopcli.vehicles.parameters import read_vehicle_file

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


def _alike(wanted: Fingerprint) -> dict[str, str]:
    """The shipped vehicles that have these parameters by name, with their titles."""
    files = {path.stem: read_vehicle_file(path) for path in sorted((data_folder() / "vehicles").glob("*.toml"))}
    return {name: file.title for name, file in files.items() if fingerprint(file.parameters, wanted.names) == wanted}


def _own(wanted: Fingerprint) -> str:
    return f"own vehicle {wanted.digest[:DIGITS]}"
