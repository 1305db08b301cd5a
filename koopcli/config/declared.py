"""All settings of an experiment as they are declared, for whoever lists or completes them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import Field, fields, is_dataclass
from typing import Any, NamedTuple

from koopcli.choices import Choice, choices, hints_of, without_none
from koopcli.config.pictures import PlotOptions
from koopcli.config.settings import About, Baseline, Evaluate, Reproduce, Simulate
from koopcli.koopman.edmd.fit import FitEdmd
from koopcli.koopman.eigen.fit import FitEigen
from koopcli.simulation.samples.sample import SampleChoice
from koopcli.vehicles.parameters import VehicleParameters

DECLARED: dict[str, type[Any]] = {
    "experiment": About,
    "vehicle": VehicleParameters,
    "simulate": Simulate,
    "fit-edmd": FitEdmd,
    "fit-eigen": FitEigen,
    "baseline": Baseline,
    "evaluate": Evaluate,
    "plot": PlotOptions,
    "reproduce": Reproduce,
}  # settings by section, but for those of samples
KINDS: dict[str, dict[str, type[SampleChoice]]] = {
    "sample": SampleChoice.kinds(),
    "test": {name: kind for name, kind in SampleChoice.kinds().items() if kind.tests},
}  # kinds of sample by section


class Declared(NamedTuple):
    """A setting: the ``table`` that it may stand in, the names that it may be set by, its type and its field."""

    table: str
    name: str
    hint: Any
    field: Field[Any]

    @property
    def full_name(self) -> str:
        """The name that holds for one kind, in effect or not."""
        return f"{self.table}.{self.name}"

    @property
    def short_name(self) -> str:
        """The name that holds for the kind in effect."""
        return f"{self.table.partition('.')[0]}.{self.name}"


def every_setting() -> Iterator[Declared]:
    """Every setting of every section and kind."""
    for section, cls in DECLARED.items():
        yield from _of(section, cls)
        if section == "vehicle":  # samples are what the sections after it are about
            for of_samples, kinds in KINDS.items():
                for name, kind in kinds.items():
                    yield from _of(f"{of_samples}.{name}", kind)


def _of(table: str, cls: type[Any]) -> Iterator[Declared]:
    hints = hints_of(cls)
    for f in fields(cls):
        if "help" not in f.metadata:
            continue
        yield Declared(table, f.name, hints[f.name], f)
        if f.name in choices(cls):
            for name, kind in choices(cls)[f.name].kinds().items():
                yield from _of(f"{table}.{f.name}.{name}", kind)


def entries(setting: Declared) -> list[str]:
    """The names in the table that a setting is, such as ``mu`` of ``vehicle.lateral``; none of one that is a value."""
    bare = without_none(setting.hint)
    return [f.name for f in fields(bare)] if is_dataclass(bare) else []


def is_choice(name: str) -> bool:
    """Whether a setting of this ``name`` is a choice among kinds."""
    bare = (without_none(setting.hint) for setting in every_setting() if setting.name == name)
    return any(isinstance(hint, type) and issubclass(hint, Choice) for hint in bare)
