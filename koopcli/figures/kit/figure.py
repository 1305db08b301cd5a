"""What a figure is: what it says of itself, what it is given, and what is drawn of that."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import zip_longest
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt

from koopcli.config.experiment import Experiment
from koopcli.config.pictures import Plot, Series
from koopcli.config.settings import FitName
from koopcli.content import Content
from koopcli.errors import InvalidValueError
from koopcli.figures import module_of
from koopcli.figures.kit import style
from koopcli.figures.kit.signature import signature
from koopcli.records import Array, BoolArray, Channels, FloatArray, Packed

LOST = " (all diverged)"  # after the name of one among several that has no error to draw
Recipes = Any  # the module koopcli.stages.recipes, which is handed over: figures stand below the stages
Task = Any  # of koopcli.stages.base, for the same reason
Takes = Literal[
    "evaluation", "predictor", "fit", "sample", "trajectories", "sweep", "log", "selection", "score", "loop", "nothing"
]
TAKES: dict[Takes, tuple[str, ...]] = {
    "evaluation": ("evaluate",),
    "predictor": (*get_args(FitName), "baseline"),
    "fit": get_args(FitName),
    "sample": ("sample",),
    "trajectories": ("simulate",),
    "sweep": ("sweep",),
    "log": ("import",),
    "selection": ("select",),
    "score": ("score",),
    "loop": ("control",),
    "nothing": (),
}  # the stages that make what a figure takes


@dataclass(frozen=True)
class FigureKind:
    """A figure: what it shows, takes and is told, and what it makes when no artefact is named."""

    about: str
    """What it shows, in a line."""
    takes: Takes
    """The artefacts that it draws, a ``fit`` being a predictor with lifted states."""
    behind: tuple[str, ...] = ()
    """What else it reads of each: its ``predictor``, its ``trajectories`` (the test set), or its ``training``."""
    draws: Literal["one", "beside", "points"] = "one"
    """One artefact, several beside one another on one test set, or several as points of curves."""
    against: str = "order"
    """The axis of the points, one of ``koopcli.stages.naming.AXES``."""
    kinds: tuple[str, ...] = ()
    """The kinds of sample that it takes; all when left out."""
    told: Mapping[str, Callable[[Recipes, Experiment, Sequence[Task]], Any]] = field(default_factory=dict)
    """Fields of ``Plot`` that it uses, each with its value for the artefacts that are drawn."""
    parameters: tuple[str, ...] = ()
    """Parameters that it draws of the experiment's vehicles, where it takes no artefact."""
    makes: Callable[[Recipes, Experiment], list[Task]] | None = None
    """What it draws when nothing is named; when left out, the usual one of what it takes."""
    usual: FitName | None = None
    """Of one that can be drawn for either fit, the one that it makes unless the experiment is about the other."""
    only: FitName | None = None
    """The fit that it makes, of one that can be drawn for no other."""
    instead: str = ""
    """What to change instead of what it chooses itself."""

    @property
    def roles(self) -> tuple[str, ...]:
        """The records that it reads of each artefact, that of the artefact itself first."""
        itself = {"nothing": (), "fit": ("predictor",)}.get(self.takes, (self.takes,))
        return (*itself, *self.behind)

    @property
    def stages(self) -> tuple[str, ...]:
        """The stages that make what it takes."""
        return TAKES[self.takes]


@dataclass(frozen=True)
class Source:
    """One drawn artefact: what it is called among several, and the records of it and of what it was made from."""

    label: str
    at: float | None
    records: Mapping[str, Any]


def sources_of(settings: Plot, inputs: Mapping[str, Any]) -> list[Source]:
    """The drawn artefacts from records by ``number/role``."""
    records: dict[int, dict[str, Any]] = {}
    for name, record in inputs.items():
        number, _, role = name.partition("/")
        records.setdefault(int(number), {})[role] = record
    series = settings.series or (Series(""),) * len(records)
    return [Source(entry.label, entry.at, records[i]) for i, entry in enumerate(series)]


@dataclass(frozen=True, eq=False, repr=False)
class Drawing(Content):
    """``numbers``: what is drawn, by column; ``image``: the rendered file of ``format``."""

    figure: str
    format: str
    numbers: Mapping[str, Array]
    image: bytes

    def table(self) -> tuple[list[str], list[list[Any]]]:
        """The numbers as a table: column names with units, and rows; short columns end in empty cells."""
        columns = [array.values[...].tolist() for array in self.numbers.values()]
        header = [f"{name} ({array.units})" for name, array in self.numbers.items()]
        return header, [list(row) for row in zip_longest(*columns, fillvalue="")]

    def pack(self) -> Packed:
        """The drawing for storage."""
        image = Array(np.frombuffer(self.image, dtype=np.uint8), ("byte",), "1")
        arrays = {"image": image, **{f"numbers/{name}": a for name, a in self.numbers.items()}}
        return Packed(arrays, {"figure": self.figure, "format": self.format, "columns": list(self.numbers)})

    @classmethod
    def unpack(cls, packed: Packed) -> Drawing:
        """The inverse of :meth:`pack`."""
        stored = {name: packed.arrays[f"numbers/{name}"] for name in packed.meta["columns"]}
        numbers = {name: Array(a.values[...], a.axes, a.units) for name, a in stored.items()}
        return cls(
            packed.meta["figure"],
            packed.meta["format"],
            numbers,
            packed.arrays["image"].values[...].tobytes(),
        )


def drawing(settings: Plot, inputs: Mapping[str, Any], version: str = "") -> Drawing:
    """The figure that ``settings`` ask for, from records by ``number/role``, as this ``version`` of koop draws it."""
    module = module_of(settings.figure)
    shown = module.select(sources_of(settings, inputs), settings)
    image = style.render(module.draw(shown), settings.format, signature(settings.of, version))
    return Drawing(settings.figure, settings.format, _apart(module.numbers(shown)), image)


def _apart(numbers: Mapping[str, Array]) -> dict[str, Array]:
    """The columns, with axes of different lengths told apart where a group has them under one name."""
    lengths: dict[tuple[str, str], list[int]] = {}
    columns = {}
    for name, array in numbers.items():
        (axis,), (length,) = array.axes, array.values.shape
        known = lengths.setdefault((name.rpartition("/")[0], axis), [])
        if length not in known:
            known.append(length)
        number = known.index(length) + 1
        columns[name] = replace(array, axes=(axis if number == 1 else f"{axis}_{number}",))
    return columns


def column(values: npt.ArrayLike, axis: str, unit: str) -> Array:
    """One drawn column."""
    return Array(np.asarray(values, dtype=float), (axis,), unit)


def state_columns(x: FloatArray, channels: Channels, axis: str, name: str = "{}") -> dict[str, Array]:
    """States (n, n_x) as a column each, called ``name`` with the state's own in place of the braces."""
    named = zip(channels.names, channels.units, strict=True)
    return {name.format(state): column(x[:, i], axis, unit) for i, (state, unit) in enumerate(named)}


def with_error(sources: Sequence[Source]) -> list[BoolArray]:
    """Which trajectories (n,) of each drawn evaluation have an error: those that neither diverged nor are zero.

    Raises ``InvalidValueError`` where none of any evaluation has.
    """
    evaluations = [source.records["evaluation"] for source in sources]
    shown = [np.asarray(np.isfinite(evaluation.rmse) & ~evaluation.diverged) for evaluation in evaluations]
    if not any(mask.any() for mask in shown):
        whose = "this evaluation" if len(sources) == 1 else "these evaluations"
        raise InvalidValueError(f"every prediction of {whose} diverged: there is no error to draw")
    return shown
