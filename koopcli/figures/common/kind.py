"""What a figure says of itself: the declaration ``FIGURE`` in its file."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, get_args

from koopcli.config.experiment import Experiment
from koopcli.config.settings import FitName

Recipes = Any  # the module koopcli.stages.recipes, which is handed over: figures stand below the stages
Task = Any  # of koopcli.stages.base, for the same reason
Takes = Literal["evaluation", "predictor", "fit", "sample", "trajectories", "sweep", "nothing"]
TAKES: dict[Takes, tuple[str, ...]] = {
    "evaluation": ("evaluate",),
    "predictor": (*get_args(FitName), "baseline"),
    "fit": get_args(FitName),
    "sample": ("sample",),
    "trajectories": ("simulate",),
    "sweep": ("sweep",),
    "nothing": (),
}  # the stages that make what a figure takes


@dataclass(frozen=True)
class FigureKind:
    """A figure: what it shows, takes and is told, and what it makes when no artefact is named.

    Whatever makes tasks is handed the recipes and the experiment. It has to be a lambda where it is written below.
    """

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
    fit: FitName | None = None
    """The fit that it makes, if any, unless the experiment is about the other one and the figure ``follows`` that."""
    follows: bool = False
    """Whether it can be drawn for either fit."""
    reads: tuple[str, ...] = ()
    """Beginnings of settings that matter beside those of the tasks."""
    fixed: tuple[str, ...] = ()
    """Beginnings of settings that the figure chooses itself."""
    instead: str = ""
    """What to do instead of changing those."""

    @property
    def roles(self) -> tuple[str, ...]:
        """The records that it reads of each artefact, that of the artefact itself first."""
        itself = {"nothing": (), "fit": ("predictor",)}.get(self.takes, (self.takes,))
        return (*itself, *self.behind)

    @property
    def uses(self) -> tuple[str, ...]:
        """Settings that matter beside those of the tasks, with those that the figure is told."""
        return (*self.reads, *(f"plot.{name}" for name in self.told))

    def chooses(self, name: str, experiment: Experiment) -> bool:
        """Whether the figure chooses the setting ``name`` itself; a figure that follows leaves the fit open."""
        own = f"{experiment.about.fit or self.fit}."
        return f"{name}.".startswith(self.fixed) and not (self.follows and name.startswith(own))
