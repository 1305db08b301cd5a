"""An experiment: the settings of all stages, from a TOML file with the command line laid over it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, TypeVar

from koopcli.checks import COMMAND_LINE, Origin, build, candidates, from_file
from koopcli.config.changes import SECTIONS, Changes, Values
from koopcli.config.data import locate
from koopcli.config.pictures import PlotOptions
from koopcli.config.samples import ELSEWHERE, OF_SIMULATION, OF_VEHICLE, SAMPLED_FOR, SAMPLES, SampleSettings
from koopcli.config.settings import About, Baseline, Evaluate, FitEdmd, FitEigen, Reproduce, Simulate
from koopcli.errors import InvalidValueError, KoopError, UsageError
from koopcli.parsing import parse_toml
from koopcli.text import read_text
from koopcli.vehicles.parameters import VehicleParameters, change, read_vehicle

KINDS = {"sample": tuple(SAMPLES), "test": ("box", "point", "ball", "drive-test", "manoeuvre")}
DEFAULT_VEHICLE = "ctu-2020"

T = TypeVar("T")


@dataclass(frozen=True)
class Layer:
    """Raw values, where they came from, and the folder of relative paths in them."""

    values: Mapping[str, Mapping[str, Any]]
    origin: Origin
    folder: Path


@dataclass(frozen=True)
class Experiment:
    """Settings of every stage; :meth:`sample` and :meth:`test` give those that depend on a kind and on the vehicle."""

    layers: tuple[Layer, ...]
    about: About
    simulate: Simulate
    fit_edmd: FitEdmd
    fit_eigen: FitEigen
    baseline: Baseline
    evaluate: Evaluate
    plot: PlotOptions
    reproduce: Reproduce

    @property
    def vehicle(self) -> VehicleParameters:
        """The vehicle of the training set."""
        return self.simulate.vehicle

    @property
    def vehicle_name(self) -> str:
        """What the vehicle is called: for tables only, a recipe holds its values."""
        named = [layer.values.get("vehicle", {}).get("name") for layer in self.layers]
        return Path(str(next((name for name in reversed(named) if name), DEFAULT_VEHICLE))).stem

    def before_naming(self) -> Experiment | None:
        """The experiment without the last name of a vehicle; None where there is none, or what is changed of the
        vehicle needs it.
        """
        named = [i for i, layer in enumerate(self.layers) if "name" in layer.values.get("vehicle", {})]
        if not named:
            return None
        layers = list(self.layers)
        last = layers[named[-1]]
        changed = {key: value for key, value in last.values["vehicle"].items() if key != "name"}
        layers[named[-1]] = replace(last, values={**last.values, "vehicle": changed})
        try:
            return replace(self, layers=tuple(layers))._driving(_vehicle(layers))
        except KoopError:
            return None

    def with_vehicle(self, name: str) -> Experiment:
        """The experiment with a vehicle of ``reproduce.beside``, as its file has it but for what ``--set`` changes.

        Parameters that an experiment file changes make its own vehicle and no other.
        """
        named = [layer for layer in self.layers if "beside" in layer.values.get("reproduce", {})]
        folder = named[-1].folder if named else Path()
        changed = {key: v for key, v in self.layers[-1].values.get("vehicle", {}).items() if key != "name"}
        return self._driving(change(vehicle_named(name, folder), changed, COMMAND_LINE))

    def with_parameters(self, **changed: object) -> Experiment:
        """The experiment with single parameters of its vehicle replaced."""
        return self._driving(replace(self.vehicle, **changed))  # type: ignore[arg-type]

    def _driving(self, vehicle: VehicleParameters) -> Experiment:
        return replace(self, simulate=replace(self.simulate, vehicle=vehicle))

    def sample(self, kind: str) -> SampleSettings:
        """The training sample, of ``kind`` unless the experiment names one."""
        return self._sampled("sample", kind, self.vehicle)

    def test(self, kind: str, vehicle: VehicleParameters) -> SampleSettings:
        """The test sample of a ``vehicle``, of ``kind`` unless the experiment names one."""
        return self._sampled("test", kind, vehicle)

    def tabled(self, kind: str) -> SampleSettings:
        """The test sample of a ``kind`` without a vehicle, from its tables alone, whichever kind is in effect."""
        return self._built("test", kind, {}, self.vehicle)

    def _sampled(self, section: str, kind: str, vehicle: VehicleParameters) -> SampleSettings:
        """What applies to the kind in effect: tables of that kind, and settings written outside any table.

        The latter hold for the kind that was in effect in their layer; a layer that changes the kind starts afresh.
        """
        before = kind
        loose: dict[int, Values] = {}
        for i, layer in enumerate(self.layers):
            given = layer.values.get(section, {})
            now = given.get("kind", before)
            if now != before:
                loose = {}
            before = now
            loose[i] = {key: v for key, v in given.items() if key != "kind" and not isinstance(v, Mapping)}
            _check_owner(section, now, loose[i], layer.origin)
        return self._built(section, before, loose, vehicle)

    def _built(
        self, section: str, kind: str, loose: Mapping[int, Values], vehicle: VehicleParameters
    ) -> SampleSettings:
        """The sample of ``kind`` from its tables, and from what stands ``loose`` outside of them, by layer."""
        layers, known = [], {f.name for f in fields(SAMPLES[kind])}
        for i, layer in enumerate(self.layers):
            there = layer.values.get(section, {}).get(kind)
            table = there if isinstance(there, Mapping) else {}  # grid and box samples have a setting "box" too
            layers.append(Layer({section: {**table, **loose.get(i, {})}}, layer.origin, layer.folder))
        taken: Values = {name: getattr(vehicle, name) for name in OF_VEHICLE if name in known}
        if "vehicle" in known:
            simulate = replace(self.simulate, vehicle=vehicle, plant=SAMPLED_FOR[kind]).settled()
            taken = {name: getattr(simulate, name) for name in OF_SIMULATION if name in known}
        if taken:
            layers = [Layer({section: taken}, COMMAND_LINE, Path()), *layers]
        return _section(SAMPLES[kind], section, layers).settled()


def load_experiment(name: str, changes: Changes) -> Experiment:
    """The experiment ``name`` (shipped, or a file by its path) with ``changes`` of the command line laid over it."""
    path = locate("experiments", name, "experiment")
    here = from_file(path)
    layers = (Layer(_read(path, here), here, path.parent), Layer(changes, COMMAND_LINE, Path()))
    for layer in layers:
        for section in layer.values:
            if section not in SECTIONS:
                raise layer.origin.misnamed(
                    layer.origin.say(f"unknown section '{section}'{candidates(section, SECTIONS)}")
                )
        if "vehicle" in layer.values.get("simulate", {}):
            raise layer.origin.misnamed(
                layer.origin.say("the vehicle has a section of its own: vehicle.name, vehicle.Jzz")
            )
        for section in KINDS:
            _check_sampled(section, layer)
    vehicle = Layer({"simulate": {"vehicle": _vehicle(layers)}}, COMMAND_LINE, Path())
    return Experiment(
        layers=layers,
        about=_section(About, "experiment", layers),
        simulate=_section(Simulate, "simulate", [vehicle, *layers]),
        fit_edmd=_section(FitEdmd, "fit-edmd", layers),
        fit_eigen=_section(FitEigen, "fit-eigen", layers),
        baseline=_section(Baseline, "baseline", layers),
        evaluate=_section(Evaluate, "evaluate", layers),
        plot=_section(PlotOptions, "plot", layers),
        reproduce=_section(Reproduce, "reproduce", layers),
    )


def vehicle_named(name: str, folder: Path = Path()) -> VehicleParameters:
    """The vehicle ``name`` (shipped, or a file by its path from ``folder``)."""
    return read_vehicle(locate("vehicles", name, "vehicle", folder))


def _read(path: Path, here: Origin) -> Changes:
    try:
        content = parse_toml(read_text(path))
    except (OSError, ValueError) as error:
        raise InvalidValueError(here.say(f"cannot read the experiment file: {error}")) from error
    for section, values in content.items():
        if not isinstance(values, dict):
            raise InvalidValueError(here.say(f"'{section}' must stand in a table such as [sample]"))
    return content


def _section(cls: type[T], section: str, layers: Sequence[Layer]) -> T:
    """The settings ``cls``; each layer is checked by itself, so that an error names where the value came from."""
    settled: Values = {}
    for layer in layers:
        given = layer.values.get(section, {})
        parsed = build(cls, {**settled, **given}, layer.origin, f"{section}.")
        settled |= {key: getattr(parsed, key) for key in given}
    return build(cls, settled, COMMAND_LINE, f"{section}.")


def _check_sampled(section: str, layer: Layer) -> None:
    """Refuse what no kind of sample would take, whichever will be in effect."""
    where = layer.origin
    for key, value in layer.values.get(section, {}).items():
        misnamed = value if key == "kind" else key if isinstance(value, Mapping) else None
        if misnamed is not None and misnamed not in KINDS[section]:
            raise where.misnamed(
                where.say(f"unknown kind of {section} {misnamed!r}{candidates(str(misnamed), KINDS[section])}")
            )
        if isinstance(value, Mapping):
            for name, owner in ELSEWHERE.items():
                if name in value and name in {f.name for f in fields(SAMPLES[key])}:
                    raise where.misnamed(where.say(_elsewhere(f"{section}.{key}.{name}", name, owner)))
            _check_owner(f"{section}.{key}", key, value, where)
            _try_out(key, value, where, f"{section}.{key}.")
        elif key != "kind":
            _check_loose(section, key, value, where)


def _check_loose(section: str, key: str, value: object, origin: Origin) -> None:
    """Refuse a setting outside any table that none of the kinds takes."""
    known = {kind: {f.name for f in fields(SAMPLES[kind])} - {"kind", *ELSEWHERE} for kind in KINDS[section]}
    if key in ELSEWHERE:
        raise origin.misnamed(origin.say(_elsewhere(f"{section}.{key}", key, ELSEWHERE[key])))
    owners = [kind for kind in known if key in known[kind]]
    if not owners:
        every = sorted(set().union(*known.values()))
        raise origin.misnamed(origin.say(f"unknown setting '{section}.{key}'{candidates(key, every)}"))
    refused: list[KoopError] = []
    for kind in owners:
        try:
            _try_out(kind, {key: value}, origin, f"{section}.")
        except (UsageError, InvalidValueError) as error:
            refused.append(error)
    if len(refused) == len(owners):
        raise refused[0]


def _elsewhere(name: str, key: str, owner: str) -> str:
    """What is said of a setting that a sample takes from another section."""
    remedy = "choose it by vehicle.name" if key == owner else f"set {owner}.{key}"
    return f"'{name}' is {'the vehicle' if owner == 'vehicle' else 'the simulation'}'s: {remedy}"


def _try_out(kind: str, values: Mapping[str, Any], origin: Origin, prefix: str) -> None:
    """Build a sample of ``kind``, a stand-in for the vehicle that is not known yet."""
    stand_in: Values = {f.name: 1.0 for f in fields(SAMPLES[kind]) if f.name in ELSEWHERE}
    if "vehicle" in stand_in:
        stand_in |= {"vehicle": VehicleParameters(m=1.0, Jzz=1.0, l_f=1.0, l_r=1.0, c_w=0.0, A=0.0, rho=0.0)}
    build(SAMPLES[kind], {**stand_in, **values}, origin, prefix)


def _check_owner(section: str, kind: str, given: Mapping[str, Any], origin: Origin) -> None:
    """Refuse settings that a sample of ``kind`` does not have, saying whose they are."""
    for key in given:
        owners = [name for name, cls in SAMPLES.items() if key in {f.name for f in fields(cls)}]
        if owners and kind not in owners:
            whose, what = " or ".join(f"'{owner}'" for owner in owners), section.partition(".")[0]
            raise origin.misnamed(
                origin.say(f"'{section}.{key}' belongs to kind {whose}, this {what} is of kind '{kind}'")
            )


def _vehicle(layers: Sequence[Layer]) -> VehicleParameters:
    """The vehicle named last, with the single parameters that its own or a later layer changes."""
    vehicle = vehicle_named(DEFAULT_VEHICLE)
    for layer in layers:
        given = dict(layer.values.get("vehicle", {}))
        if "name" in given:
            vehicle = vehicle_named(str(given.pop("name")), layer.folder)
        vehicle = change(vehicle, given, layer.origin)
    return vehicle
