"""What is said to a predictor that does not beat its baselines: why that is so, and what was measured to do better."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from koopcli.choices import written
from koopcli.config.experiment import load_experiment
from koopcli.config.measured import COASTING, INPUTS, TYRES, WHEELS, Gain
from koopcli.config.settings import FitName
from koopcli.koopman.edmd.fit import FitEdmd
from koopcli.records import Meta
from koopcli.simulation.samples.ellipsoid import EllipsoidSample
from koopcli.simulation.samples.greedy import GreedySample
from koopcli.simulation.samples.grid import GridSample
from koopcli.simulation.samples.sample import SampleChoice
from koopcli.stages.asked import tested_on
from koopcli.stages.base import Task
from koopcli.stages.fits import LIFTED
from koopcli.stages.roles import roles_of

PAGES = {"forces": "docs/paper.md", "slips": "docs/beyond.md", "wheels": "docs/wheels.md"}
COASTING_ORDER = 10  # on even points, of which it needs one more
FEW = {"basis": "total", "order": 2, "terms": "bilinear"}  # the fit on wheels


@dataclass(frozen=True)
class Case:
    """A predictor and its test, as far as the advice depends on them."""

    plant: str
    """The plant of both."""
    fit: Any
    """The settings of the predictor's fit."""
    sample: SampleChoice | None
    """Where its training trajectories start; None where that is no longer known, or of several."""
    trained: bool
    """Whether inputs move the training trajectories."""
    tested: bool
    """Whether inputs move the test trajectories."""
    elsewhere: bool = False
    """Whether the test trajectories are of another vehicle, or of another setting of the plant."""
    diverged: bool = False
    """Whether predictions diverge."""

    @property
    def edmd(self) -> bool:
        """Whether EDMD made the predictor."""
        return isinstance(self.fit, FitEdmd)


@dataclass(frozen=True)
class Better:
    """A predictor that was measured to do better, as a change of the experiment at hand."""

    fit: FitName
    data: Literal["same", "own"]
    """Whether it is fitted to the same data, or brings its own."""
    gain: Gain
    experiment: str = "paper"
    """The shipped experiment that has its settings."""
    sample: Mapping[str, Any] = field(default_factory=dict)
    """Settings of its sample beside those."""
    changes: Mapping[str, Any] = field(default_factory=dict)
    """Settings of its fit beside those."""
    keeps: tuple[str, ...] = ()
    """Settings that its own sample takes over from the data at hand."""


@dataclass(frozen=True)
class Advice:
    """Why a predictor does not beat its baselines, and what to do."""

    why: str
    page: str = ""
    """Where more is said; nothing where the reason says what to do."""
    better: Better | None = None
    own_test: bool = False
    """Whether to test it on its own vehicle."""


def case_of(evaluation: Task, figures: Meta) -> Case | None:
    """The case of an evaluation; None for a baseline, which is meant to be poor, and where its data are gone."""
    predictor, test = evaluation.input("predictor"), evaluation.input("trajectories")
    inputs, tested = dict(predictor.inputs), test.find("sample")
    data = [inputs[role] for role in roles_of(inputs)]
    samples = [sample.settings for task in data if (sample := task.find("sample")) is not None]
    if predictor.stage not in LIFTED or not data or len(samples) < len(data) or tested is None:
        return None
    mine, theirs = tested_on(predictor, data[0].settings), test.settings
    assert mine.plant is not None, "settled when it was simulated"
    return Case(
        plant=mine.plant.kind,
        fit=predictor.settings,
        sample=samples[0] if len(samples) == 1 else None,
        trained=any(sample.driven for sample in samples),
        tested=tested.settings.driven,
        elsewhere=any(getattr(mine, name) != getattr(theirs, name) for name in ("plant", "vehicle", "dt")),
        diverged=figures["diverged"] > 0,
    )


def advise(case: Case) -> Advice:
    """The advice on a predictor that does not beat its baselines."""
    if case.elsewhere:
        return Advice("the test trajectories are of another vehicle or plant than the predictor", own_test=True)
    if case.edmd and case.tested and not case.trained:
        return Advice(
            "no input moves in the training data, so the predictor knows nothing of them: sample some that do"
        )
    why = next(text for holds, text in REASONS if holds(case))
    return Advice(why, PAGES.get(case.plant, ""), RULES[case.plant](case) if case.plant in RULES else None)


REASONS: tuple[tuple[Callable[[Case], bool], str], ...] = (
    (
        lambda case: case.edmd and case.diverged and case.fit.basis.kind != "states",
        "outside the data the fitted functions grow without bound",
    ),
    (
        lambda case: case.edmd and case.tested and case.fit.terms.kind == "linear",
        "a constant B limits it: inputs act through products with the state",
    ),
    (
        lambda case: case.edmd and case.tested and case.fit.terms.kind == "bilinear",
        "bilinear steps leave out what is of second order in the inputs",
    ),
    (
        lambda case: case.edmd and case.plant != "forces",
        "tyre forces saturate, which these functions do not follow",
    ),
    (
        lambda case: case.edmd and not case.tested,
        "without inputs the exact equations, linearised at each state, are hard to beat",
    ),
    (
        lambda case: isinstance(case.sample, EllipsoidSample) and case.sample.shells == 1,
        "trajectories from one surface leave the middle of the volume empty",
    ),
    (lambda case: True, "errors are large where data are missing"),
)  # the first that holds is said


def _forces(case: Case) -> Better | None:
    """Bilinear terms where inputs act; else more powers, on points that cover the box."""
    if not case.edmd:
        return None
    grid = case.sample if isinstance(case.sample, GridSample) else None
    if case.tested:
        best = load_experiment("best-edmd", {}).fit_edmd
        usual = written(best)["order"]
        order = usual if grid is None else min(usual, grid.count - 1)
        changes = {} if order == usual else {"order": order}
        if order < 1 or _same_fit(case.fit, best.but(order=order)):
            return None
        return Better("fit-edmd", "same", INPUTS, "best-edmd", changes=changes)
    wanted = FitEdmd.of(order=COASTING_ORDER)
    if grid is None or grid.count <= COASTING_ORDER or (_same_fit(case.fit, wanted) and grid.draw == "even"):
        return None
    return Better(
        "fit-edmd",
        "own",
        COASTING,
        sample={"draw": "even"},
        changes={"order": COASTING_ORDER},
        keeps=("seed", "count", "box", "levels", "columns"),
    )


def _slips(case: Case) -> Better | None:
    """The best eigenfunctions, for whatever coasts on tyres."""
    best = load_experiment("best-eigen", {})
    if isinstance(case.sample, GreedySample) and case.fit == best.fit_eigen:
        return None
    return None if case.tested else Better("fit-eigen", "own", TYRES, "best-eigen", keeps=("energy",))


def _wheels(case: Case) -> Better | None:
    """Bilinear terms of few functions."""
    if not case.edmd or case.fit.terms.kind != "linear" or not case.tested:
        return None
    return Better("fit-edmd", "same", WHEELS, changes=FEW)


RULES = {"forces": _forces, "slips": _slips, "wheels": _wheels}


def _same_fit(a: FitEdmd, b: FitEdmd) -> bool:
    """Whether two fits have the same functions and terms."""
    return (a.basis, a.terms) == (b.basis, b.terms)
