"""Stage ``select``: the predictor of a log among a few, and the verdict of blocks held out."""

from __future__ import annotations

from dataclasses import dataclass, replace

from koopcli.checks import build
from koopcli.choices import setting
from koopcli.koopman.edmd.fit import FitEdmd
from koopcli.koopman.edmd.increments import RIDGE
from koopcli.koopman.selection.record import Selection
from koopcli.koopman.selection.regress import Rung
from koopcli.koopman.selection.select import judged, laid_out, select
from koopcli.koopman.selection.verdict import Block
from koopcli.progress import Progress
from koopcli.records import Meta, Packed
from koopcli.stages.base import Context, Cost, Inputs, Stage


@dataclass(frozen=True)
class Select:
    """A ladder of predictors, every combination of its lists, and how many blocks are held out in turn."""

    memory: tuple[float, ...] = setting((0.2,), low=0, high=1e3, unique=True, unit="s", help="past in the lift")
    products: tuple[bool, ...] = setting((False, True), unique=True, help="products of inputs with present states")
    order: tuple[int, ...] = setting((1,), low=1, high=2, unique=True, help="degree of the present states")
    ridge: tuple[float, ...] = setting((RIDGE,), low=0, high=1e6, unique=True, help="penalty towards hold")
    blocks: int = setting(3, low=2, high=100, option=True, help="parts of the log, each held out once")
    bicycle: bool = setting(True, help="compare with a bicycle identified from the same rows")

    @property
    def rungs(self) -> tuple[Rung, ...]:
        """The ladder, the simplest first."""
        return tuple(
            Rung(memory, products, order, ridge)
            for order in self.order
            for memory in self.memory
            for ridge in self.ridge
            for products in self.products
        )


def fit_of(rung: Rung, dt: float) -> FitEdmd:
    """The settings of ``fit-edmd`` that make the predictor of a ``rung`` on a whole log with steps of ``dt`` s: its
    memory is as many of them as are nearest.
    """
    terms, memory = "products" if rung.products else "linear", round(rung.past(dt) * dt, 9)
    return FitEdmd.of(basis="total", order=rung.order, terms=terms, memory=memory, increment_ridge=rung.ridge)


def _run(settings: Select, inputs: Inputs, context: Context) -> Selection:
    episodes = inputs["trajectories"].episodes
    laid_out(episodes, settings.rungs, settings.blocks)  # which refuses a log that is too short, once
    blocks = [Block.unpack(part) for part in context.chunks(settings.blocks, 1)]
    selection = select(episodes, settings.rungs, settings.blocks, settings.bicycle, blocks)
    asked = sorted({check.name.replace("_", " ") for check in inputs["trajectories"].checks if check.verdict == "ask"})
    if asked:
        doubt = f"The log is in doubt: koop import asks about {', '.join(asked)}."
        selection = replace(selection, verdict=f"{selection.verdict} {doubt}")
    return selection


def _chunk(settings: Select, inputs: Inputs, rows: slice, progress: Progress) -> Packed:
    """One block held out."""
    episodes = inputs["trajectories"].episodes
    return judged(episodes, settings.rungs, settings.blocks, settings.bicycle, rows.start).pack()


def _describe(figures: Meta, settings: Select) -> str:
    text = f"{figures['chosen_rung']} of {len(settings.rungs)} predictors"
    return f"{text}: {figures['ratio_to_dmdc']:.2f} × DMDc, {figures['ratio_to_hold']:.2f} × hold"


STAGE = Stage(
    name="select",
    version=1,
    settings=lambda values: build(Select, values),
    run=_run,
    unpack=Selection.unpack,
    figures=Selection.figures,
    describe=_describe,
    check=lambda task: None,
    chunk=_chunk,
    estimate=lambda task: Cost(2.0 + 1.5 * len(task.settings.rungs) * task.settings.blocks, 1e5),
)
