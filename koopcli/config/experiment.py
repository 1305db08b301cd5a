"""An experiment: the settings of all stages, from a TOML file with the command line laid over it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

from koopcli.checks import (
    COMMAND_LINE,
    Layer,
    Origin,
    build_layers,
    candidates,
    check_choice,
    choose,
    chosen_kind,
    from_file,
)
from koopcli.choices import names_of, taken, written
from koopcli.config.changes import SECTIONS, Changes, flat, nested
from koopcli.config.data import locate
from koopcli.config.declared import DECLARED, KINDS
from koopcli.config.pictures import PlotOptions
from koopcli.config.settings import About, Baseline, Evaluate, Reproduce, Simulate
from koopcli.config.shipped import vehicle_named
from koopcli.errors import InvalidValueError, KoopError
from koopcli.koopman.edmd.fit import FitEdmd
from koopcli.koopman.eigen.fit import FitEigen
from koopcli.parsing import parse_toml
from koopcli.simulation.samples.sample import SampleChoice
from koopcli.text import read_text
from koopcli.vehicles.parameters import VehicleParameters, change
from koopcli.vehicles.plants.plant import PlantChoice

DEFAULT_VEHICLE = "ctu-2020"

T = TypeVar("T")


@dataclass(frozen=True, eq=False)  # known by identity, as what follows from them is kept
class Sections:
    """Raw values by section, where they came from, and the folder of relative paths in them."""

    values: Mapping[str, Mapping[str, Any]]
    origin: Origin
    folder: Path

    def section(self, name: str) -> Layer:
        """The values of a section."""
        return Layer(self.values.get(name, {}), self.origin)


@dataclass(frozen=True)
class Experiment:
    """Settings of every stage; :meth:`sample` and :meth:`test` give those that depend on a kind and on the vehicle."""

    sources: tuple[Sections, ...]
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
        named = [source.values.get("vehicle", {}).get("name") for source in self.sources]
        return Path(str(next((name for name in reversed(named) if name), DEFAULT_VEHICLE))).stem

    def before_naming(self) -> Experiment | None:
        """The experiment without the last name of a vehicle; None if it names none, or changes a parameter that only
        the named vehicle has.
        """
        named = [i for i, layer in enumerate(self.sources) if "name" in layer.values.get("vehicle", {})]
        if not named:
            return None
        layers = list(self.sources)
        last = layers[named[-1]]
        changed = {key: value for key, value in last.values["vehicle"].items() if key != "name"}
        layers[named[-1]] = replace(last, values={**last.values, "vehicle": changed})
        try:
            return replace(self, sources=tuple(layers))._driving(_vehicle(layers))
        except KoopError:
            return None

    def with_vehicle(self, name: str) -> Experiment:
        """The experiment with a vehicle of ``reproduce.beside``, as its file has it but for what ``--set`` changes.

        Parameters that an experiment file changes make its own vehicle and no other.
        """
        named = [layer for layer in self.sources if "beside" in layer.values.get("reproduce", {})]
        folder = named[-1].folder if named else Path()
        changed = {key: v for key, v in self.sources[-1].values.get("vehicle", {}).items() if key != "name"}
        return self._driving(change(vehicle_named(name, folder), changed, COMMAND_LINE))

    def with_parameters(self, **changed: object) -> Experiment:
        """The experiment with single parameters of its vehicle replaced."""
        return self._driving(replace(self.vehicle, **changed))  # type: ignore[arg-type]

    def _driving(self, vehicle: VehicleParameters) -> Experiment:
        return replace(self, simulate=replace(self.simulate, vehicle=vehicle))

    def sample(self, usual: str) -> SampleChoice:
        """The training sample, of the ``usual`` kind unless the experiment names one."""
        return self.sampled("sample", usual)

    def test(self, usual: str, vehicle: VehicleParameters) -> SampleChoice:
        """The test sample of a ``vehicle``, of the ``usual`` kind unless the experiment names one."""
        return self.sampled("test", usual, vehicle)

    def tabled(self, kind: str, section: str = "test") -> SampleChoice:
        """The sample of a ``kind``, from its tables alone, whichever kind is in effect."""
        return self.sampled(section, kind, tables=True)

    def sampled(
        self, section: str, usual: str, vehicle: VehicleParameters | None = None, *, tables: bool = False
    ) -> SampleChoice:
        """The sample of a ``section``, of the ``usual`` kind unless the experiment names one."""
        return _sample(self.sources, self.simulate, section, usual, vehicle or self.vehicle, tables)

    def plant_for(self, kind: type[PlantChoice]) -> PlantChoice:
        """The plant of a ``kind``, whichever is in effect, with what the experiment says of it."""
        return _plant(self.sources, self.simulate, kind.kind)

    def fit(self, section: str, **chosen: str) -> Any:
        """The settings of a fit with other kinds ``chosen``, which have what the experiment says of them in tables."""
        layers = [source.section(section) for source in self.sources]
        return build_layers(DECLARED[section], [*layers, Layer(chosen)], f"{section}.")

    @property
    def measured_fit(self) -> FitEdmd:
        """How a log is fitted: by the states and their past, but for what the command line changes."""
        usual = Layer({"basis": "total", "order": 1})
        return build_layers(FitEdmd, [usual, self.sources[-1].section("fit-edmd")], "fit-edmd.")

    def given(self, name: str) -> object:
        """The raw value that the command line gives a setting by its full ``name``."""
        return dict(flat(self.sources[-1].values))[name]

    def settings(self, section: str) -> Any:
        """The settings of a ``section``, but for those of samples."""
        return self.about if section == "experiment" else getattr(self, section.replace("-", "_"))

    def without(self, name: str) -> Experiment:
        """The experiment without a change of the command line."""
        changes = nested((setting, value) for setting, value in flat(self.sources[-1].values) if setting != name)
        return _experiment((*self.sources[:-1], replace(self.sources[-1], values=changes)))


@lru_cache(maxsize=256)  # a reproduction asks for the same few thousands of times
def _sample(
    sources: tuple[Sections, ...],
    simulate: Simulate,
    section: str,
    usual: str,
    vehicle: VehicleParameters,
    tables: bool,
) -> SampleChoice:
    """The sample of a ``section`` for a ``vehicle``, of the ``usual`` kind unless ``sources`` name one; of their
    ``tables`` alone if so told.
    """
    layers = [source.section(section) for source in sources]
    if tables:
        layers = [layer.only(lambda key, value: isinstance(value, Mapping)) for layer in layers]
    kinds = KINDS[section]
    kind = kinds[chosen_kind(kinds, layers, usual)]
    plant = _plant(sources, simulate, kind.meant_for.kind)
    values = {**vars(vehicle), **written(plant), "vehicle": plant.used(vehicle), "dt": simulate.dt}
    beside = {name: values[name] for name in taken(kind)}
    sample: SampleChoice = choose(kinds, layers, usual, f"{section}.", section, beside)
    return sample


@lru_cache(maxsize=256)
def _plant(sources: tuple[Sections, ...], simulate: Simulate, kind: str) -> PlantChoice:
    """The plant of a ``kind``, whichever is in effect."""
    if simulate.plant is not None and simulate.plant.kind == kind:
        return simulate.plant
    names = {"plant", *names_of(PlantChoice.kinds()[kind])}
    layers = [source.section("simulate").only(lambda key, value: key in names) for source in sources]
    plant = build_layers(Simulate, [*layers, Layer({"plant": kind})], beside={"vehicle": simulate.vehicle}).plant
    assert plant is not None, "chosen"
    return plant


def load_experiment(name: str, changes: Changes) -> Experiment:
    """The experiment ``name`` (shipped, or a file by its path) with ``changes`` of the command line laid over it."""
    path = locate("experiments", name, "experiment")
    here = from_file(path)
    return _experiment((Sections(_read(path, here), here, path.parent), Sections(changes, COMMAND_LINE, Path())))


def _experiment(sources: tuple[Sections, ...]) -> Experiment:
    """The experiment of ``sources``, of which later ones win."""
    for source in sources:
        for section in source.values:
            if section not in SECTIONS:
                raise source.origin.misnamed(
                    source.origin.say(f"unknown section '{section}'{candidates(section, SECTIONS)}")
                )
    for section, kinds in KINDS.items():
        check_choice(kinds, [source.section(section) for source in sources], None, f"{section}.", section)

    def settings(cls: type[T], section: str, **beside: object) -> T:
        return build_layers(cls, [source.section(section) for source in sources], f"{section}.", beside)

    return Experiment(
        sources=sources,
        about=settings(About, "experiment"),
        simulate=settings(Simulate, "simulate", vehicle=_vehicle(sources)),
        fit_edmd=settings(FitEdmd, "fit-edmd"),
        fit_eigen=settings(FitEigen, "fit-eigen"),
        baseline=settings(Baseline, "baseline"),
        evaluate=settings(Evaluate, "evaluate"),
        plot=settings(PlotOptions, "plot"),
        reproduce=settings(Reproduce, "reproduce"),
    )


def _read(path: Path, here: Origin) -> Changes:
    try:
        content = parse_toml(read_text(path))
    except (OSError, ValueError) as error:
        twice = 'a choice that has tables is made in its own, such as kind = "total" in [fit-edmd.basis]'
        remedy = f": {twice}" if "overwrite" in str(error) else ""
        raise InvalidValueError(here.say(f"cannot read the experiment file: {error}{remedy}")) from error
    for section, values in content.items():
        if not isinstance(values, dict):
            raise InvalidValueError(here.say(f"'{section}' must stand in a table such as [sample]"))
    return content


def _vehicle(layers: Sequence[Sections]) -> VehicleParameters:
    """The vehicle named last, with the single parameters that its own or a later layer changes."""
    vehicle = vehicle_named(DEFAULT_VEHICLE)
    for layer in layers:
        given = dict(layer.values.get("vehicle", {}))
        if "name" in given:
            vehicle = vehicle_named(str(given.pop("name")), layer.folder)
        vehicle = change(vehicle, given, layer.origin)
    return vehicle
