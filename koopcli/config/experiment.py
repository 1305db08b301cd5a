"""An experiment: the settings of all stages, from a TOML file with the command line laid over it."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TypeVar

from koopcli.checks import COMMAND_LINE, Origin, build, candidates, from_file
from koopcli.config.data import locate
from koopcli.config.settings import SAMPLES, BoxSample, Evaluate, FitEdmd, GridSample, Reproduce, Simulate
from koopcli.errors import InvalidValueError, UsageError
from koopcli.vehicles.parameters import VehicleParameters, change, read_vehicle

SECTIONS = ("vehicle", "sample", "simulate", "fit-edmd", "test", "evaluate", "reproduce")
DEFAULT_VEHICLE = "ctu-2020"

T = TypeVar("T")
Values = dict[str, object]
Changes = dict[str, Values]  # section -> setting -> raw value
Layer = tuple[Changes, Origin, Path]  # the values, where they came from, and the folder of relative paths


@dataclass(frozen=True)
class Experiment:
    """Settings of every stage: ``sample`` and ``simulate`` make the training set, ``test`` the test states."""

    sample: GridSample | BoxSample
    simulate: Simulate
    fit_edmd: FitEdmd
    test: BoxSample
    evaluate: Evaluate
    reproduce: Reproduce


def load_experiment(name: str, changes: Changes) -> Experiment:
    """The experiment ``name`` (shipped, or a file by its path) with ``changes`` of the command line laid over it."""
    path = locate("experiments", name, "experiment")
    here = from_file(path)
    layers: list[Layer] = [(_read(path, here), here, path.parent), (changes, COMMAND_LINE, Path())]
    for values, origin, _ in layers:
        for section in values:
            if section not in SECTIONS:
                raise origin.misnamed(origin.say(f"unknown section '{section}'{candidates(section, SECTIONS)}"))
        if "vehicle" in values.get("simulate", {}):
            raise origin.misnamed(origin.say("the vehicle has a section of its own: vehicle.name, vehicle.Jzz"))
    vehicle: Layer = ({"simulate": {"vehicle": _vehicle(layers)}}, COMMAND_LINE, Path())
    return Experiment(
        sample=_sample(layers),
        simulate=_section(Simulate, "simulate", [vehicle, *layers]),
        fit_edmd=_section(FitEdmd, "fit-edmd", layers),
        test=_section(BoxSample, "test", layers),
        evaluate=_section(Evaluate, "evaluate", layers),
        reproduce=_section(Reproduce, "reproduce", layers),
    )


def parse_set(assignments: Sequence[str]) -> Changes:
    """``--set stage.key=value`` as changes; the value is TOML, or plain text where it is none."""
    changes: Changes = {}
    for text in assignments:
        name, equals, raw = text.partition("=")
        section, dot, key = name.strip().partition(".")
        if not (equals and dot and key):
            raise UsageError(f"--set {text}: write --set stage.key=value, such as --set vehicle.Jzz=1731")
        if section not in SECTIONS:
            raise UsageError(f"--set {text}: unknown stage '{section}'{candidates(section, SECTIONS)}")
        changes.setdefault(section, {})[key] = _toml_value(raw)
    return changes


def _toml_value(text: str) -> object:
    """``text`` as one TOML value, or as it stands."""
    try:
        parsed = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):
        return text.strip()
    return parsed["value"] if len(parsed) == 1 else text.strip()


def _read(path: Path, here: Origin) -> Changes:
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except (OSError, ValueError, RecursionError) as error:
        raise InvalidValueError(here.say(f"cannot read the experiment file: {error}")) from error
    for section, values in content.items():
        if not isinstance(values, dict):
            raise InvalidValueError(here.say(f"'{section}' must stand in a table such as [sample]"))
    return content


def _section(cls: type[T], section: str, layers: Sequence[Layer]) -> T:
    """The settings ``cls``; each layer is checked by itself, so that an error names where the value came from."""
    settled: Values = {}
    for values, origin, _ in layers:
        given = values.get(section, {})
        parsed = build(cls, {**settled, **given}, origin, f"{section}.")
        settled |= {key: getattr(parsed, key) for key in given}
    return build(cls, settled, COMMAND_LINE, f"{section}.")


def _sample(layers: Sequence[Layer]) -> GridSample | BoxSample:
    """The training sample; a layer that changes the kind starts afresh."""
    kind, relevant = "grid", list(layers)
    for i, (values, origin, _) in enumerate(layers):
        given = values.get("sample", {}).get("kind", kind)
        if not isinstance(given, str) or given not in SAMPLES:
            raise origin.misnamed(origin.say(f"unknown kind of sample {given!r}{candidates(str(given), SAMPLES)}"))
        if given != kind:
            kind, relevant = given, list(layers[i:])
        for key in values.get("sample", {}):
            owner = next((k for k, cls in SAMPLES.items() if key in {f.name for f in fields(cls)}), None)
            if owner is not None and key not in {f.name for f in fields(SAMPLES[kind])}:
                raise origin.misnamed(
                    origin.say(f"'sample.{key}' belongs to kind '{owner}', this sample is of kind '{kind}'")
                )
        build(SAMPLES[kind], values.get("sample", {}), origin, "sample.")
    return _section(SAMPLES[kind], "sample", relevant)


def _vehicle(layers: Sequence[Layer]) -> VehicleParameters:
    """The vehicle named last, with the single parameters that its own or a later layer changes."""
    vehicle = read_vehicle(locate("vehicles", DEFAULT_VEHICLE, "vehicle"))
    for values, origin, folder in layers:
        given = dict(values.get("vehicle", {}))
        if "name" in given:
            vehicle = read_vehicle(locate("vehicles", str(given.pop("name")), "vehicle", folder))
        vehicle = change(vehicle, given, origin)
    return vehicle
