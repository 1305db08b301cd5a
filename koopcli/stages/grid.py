"""From a grid of settings to tasks: one evaluation for each cell that differs from the others, shared out to shards."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from koopcli.config.changes import nested
from koopcli.config.experiment import Experiment, load_experiment
from koopcli.config.grids import Grid, GridAxis
from koopcli.config.settings import Sweep, SweepAxis
from koopcli.errors import InvalidValueError, MisplacedError, UsageError
from koopcli.progress import Progress, silent
from koopcli.simulation.samples.grid import GridSample
from koopcli.stages import recipes
from koopcli.stages.base import Task
from koopcli.stages.effects import why_idle


@dataclass(frozen=True)
class Cell:
    """One cell: its ``place`` on each axis, -1 where that has no effect, its evaluation, and why that is refused.
    ``same``: other places with the same evaluation.
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
    is refused at once; a cell whose settings do not go together, as ``check`` says, is kept with the reason. A setting
    of one kind is left out of the cells of others. Raises ``UsageError`` for a setting that changes nothing in any
    cell, and what the first cell is refused for where all of them are.
    """
    make: Callable[[Experiment], Task] = recipes.predictor if method is None else recipes.METHODS[method]

    def plan(experiment: Experiment) -> list[Task]:
        return [recipes.evaluation(experiment, make(experiment))]

    tasks: dict[tuple[int, ...], Task] = {}
    misplaced: list[MisplacedError] = []
    for count, (place, settings) in enumerate(grid.cells(), 1):
        experiment, left_out = _experiment(base, settings)
        misplaced += left_out
        (tasks[place],) = plan(experiment)
        progress(count, len(grid))
    for error in misplaced:
        if [refusal.setting for refusal in misplaced].count(error.setting) == len(grid):
            raise error
    _refuse_idle(grid, base, plan, tasks)
    cells: dict[Task, Cell] = {}
    reasons: list[InvalidValueError] = []
    for place, task in tasks.items():
        placed = tuple(-1 if _idle(grid, tasks, place, axis) else i for axis, i in enumerate(place))
        if task not in cells:
            refused = ""
            try:
                check(task)
            except InvalidValueError as error:
                refused = str(error)
                reasons.append(error)
            cells[task] = Cell(placed, task, refused)
        elif placed != cells[task].place:
            cells[task] = replace(cells[task], same=(*cells[task].same, placed))
    if len(reasons) == len(cells):
        raise reasons[0]
    return list(cells.values())


def _experiment(base: str, settings: Sequence[tuple[str, Any]]) -> tuple[Experiment, list[MisplacedError]]:
    """The experiment with the ``settings`` of a cell, and what is left out of it: those of other kinds than its own."""
    left_out: list[MisplacedError] = []
    while True:
        names = [error.setting for error in left_out]
        try:
            return load_experiment(base, nested((n, value) for n, value in settings if n not in names)), left_out
        except MisplacedError as error:
            if error.setting in names or error.setting not in dict(settings):
                raise
            left_out.append(error)


def _idle(grid: Grid, tasks: Mapping[tuple[int, ...], Task], place: tuple[int, ...], axis: int) -> bool:
    """Whether all values of an axis make one task of a cell; vehicles that make the same are told apart."""
    row = (tasks[*place[:axis], i, *place[axis + 1 :]] for i in range(len(grid.axes[axis].values)))
    return grid.axes[axis].name != "vehicle.name" and len(set(row)) == 1


def _refuse_idle(
    grid: Grid, base: str, plan: Callable[[Experiment], list[Task]], tasks: Mapping[tuple[int, ...], Task]
) -> None:
    """Raise ``UsageError`` for a setting that changes nothing in any cell."""
    alike = [axis.name for a, axis in enumerate(grid.axes) if all(_idle(grid, tasks, place, a) for place in tasks)]
    for name in [*alike, *dict(grid.fixed)]:
        reasons = []
        for place, settings in grid.cells():
            experiment, left_out = _experiment(base, settings)
            if name not in [error.setting for error in left_out]:
                reasons.append(why_idle(name, experiment, plan, [tasks[place]]))
            if reasons and reasons[-1] is None and name not in alike:  # an axis has the value in effect in some cells
                break
        else:
            raise UsageError(
                f"{name} changes nothing here: {next(filter(None, reasons), 'it is the same in every cell')}"
            )


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
    shares: list[list[int]] = [[] for _ in range(shards)]
    for n in sorted(range(len(every)), key=lambda n: (-seconds[n], n)):
        load, i = heapq.heappop(loads)
        shares[i].append(n)
        heapq.heappush(loads, (load + seconds[n], i))
    return [[every[n] for n in sorted(mine)] for mine in shares]


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
