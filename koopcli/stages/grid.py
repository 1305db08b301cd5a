"""From a grid of settings to tasks: one evaluation for each cell that differs from the others, shared out to shards."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from koopcli.config.changes import nested
from koopcli.config.experiment import Experiment, load_experiment
from koopcli.config.grids import Grid, GridAxis
from koopcli.config.samples import GridSample
from koopcli.config.settings import Sweep, SweepAxis
from koopcli.errors import InvalidValueError, UsageError
from koopcli.progress import Progress, silent
from koopcli.stages import recipes
from koopcli.stages.base import Task
from koopcli.stages.effects import why_idle


@dataclass(frozen=True)
class Cell:
    """One cell: its ``place`` on each axis, -1 where that has no effect, its evaluation, and why that is refused.
    ``same``: places that come to the same though every setting has an effect there.
    """

    place: tuple[int, ...]
    task: Task
    refused: str = ""
    same: tuple[tuple[int, ...], ...] = ()

    def told(self, grid: Grid) -> dict[str, str]:
        """Its settings, those that have an effect, in words."""
        return words(grid, self.place)


def words(grid: Grid, place: Sequence[int]) -> dict[str, str]:
    """The settings of a place, those that have an effect, in words."""
    return {axis.name: axis.texts[i] for axis, i in zip(grid.axes, place, strict=True) if i >= 0}


def cells(
    grid: Grid, method: str | None, base: str, check: Callable[[Task], None], progress: Progress = silent
) -> list[Cell]:
    """The cells of a ``grid`` over the experiment ``base``, those that come to the same only once.

    ``method``: what makes the predictors, else the fit that each experiment is about. A value that no experiment takes
    is refused at once; a cell whose settings do not go together, as ``check`` says, is kept with the reason. Raises
    ``UsageError`` for a setting that changes nothing in any cell, and what the first cell is refused for where all of
    them are.
    """
    make: Callable[[Experiment], Task] = recipes.predictor if method is None else recipes.METHODS[method]
    reads = recipes.CHOSEN if method is None else ()
    found: dict[Task, Cell] = {}
    idle: dict[str, str | None] = {}
    reasons: list[InvalidValueError] = []
    for count, (place, settings) in enumerate(grid.cells(), 1):
        experiment = load_experiment(base, nested(settings))
        task = recipes.evaluation(experiment, make(experiment))
        why = {name: why_idle(name, experiment, [task], reads) for name, _ in settings}
        idle = {name: reason and idle.get(name, reason) for name, reason in why.items()}
        placed = tuple(-1 if why[axis.name] else i for axis, i in zip(grid.axes, place, strict=True))
        if task not in found:
            refused = ""
            try:
                check(task)
            except InvalidValueError as error:
                refused = str(error)
                reasons.append(error)
            found[task] = Cell(placed, task, refused)
        elif placed != found[task].place:
            found[task] = replace(found[task], same=(*found[task].same, placed))
        progress(count, len(grid))
    for name, reason in idle.items():
        if reason:
            raise UsageError(f"{name} changes nothing here: {reason}")
    if len(reasons) == len(found):
        raise reasons[0]
    return list(found.values())


def sweep(grid: Grid, chosen: Sequence[Cell]) -> Task:
    """The scores of the ``chosen`` cells side by side."""
    axes = tuple(SweepAxis(axis.name, axis.texts) for axis in grid.axes)
    inputs = tuple((f"{i}/evaluation", cell.task) for i, cell in enumerate(chosen))
    return Task("sweep", Sweep(axes, tuple(cell.place for cell in chosen)), inputs)


def shared_out(every: Sequence[Cell], shards: int, cost: Callable[[Task], float]) -> list[list[Cell]]:
    """The cells in ``shards`` of about the same cost, by the same rule wherever it is asked: each cell in its turn, the
    dearest first, goes to the shard with the least to do.
    """
    seconds = [sum(cost(task) for task in _own(cell.task)) for cell in every]
    loads = [(0.0, i) for i in range(shards)]
    found: list[list[int]] = [[] for _ in range(shards)]
    for n in sorted(range(len(every)), key=lambda n: (-seconds[n], n)):
        load, i = heapq.heappop(loads)
        found[i].append(n)
        heapq.heappush(loads, (load + seconds[n], i))
    return [[every[n] for n in sorted(mine)] for mine in found]


def order_grid(experiment: Experiment, **tested: object) -> Task:
    """Orders of the basis by seeds of the training grid, as the reproduction has them; ``tested``: settings of the
    test sample to replace.
    """
    plan, states = experiment.reproduce, experiment.sample("grid")
    if not isinstance(states, GridSample):
        raise InvalidValueError("training draws are those of a grid: sample.kind must be 'grid'")
    axes = {"fit-edmd.order": plan.orders, "sample.seed": plan.draw_seeds}
    grid = Grid(tuple(GridAxis(name, tuple(values)) for name, values in axes.items()), ())
    chosen = []
    for place, settings in grid.cells():
        values = dict(settings)
        training = recipes.simulation(experiment, recipes.sample(replace(states, seed=values["sample.seed"])))
        fit = recipes.fit_edmd(recipes.with_order(experiment, values["fit-edmd.order"]), training)
        test = recipes.test_set(experiment, fit.ancestor("simulate").settings, **tested)
        chosen.append(Cell(place, recipes.evaluation(experiment, fit, test)))
    return sweep(grid, chosen)


def _own(evaluation: Task) -> list[Task]:
    """What a cell makes for itself: what is behind its predictor is others' too."""
    return [evaluation, evaluation.input("predictor")]
