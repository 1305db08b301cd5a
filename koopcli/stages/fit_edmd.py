"""Stage ``fit-edmd``: a predictor from trajectories by EDMD."""

from __future__ import annotations

from koopcli.checks import build
from koopcli.config.samples import GridSample
from koopcli.config.settings import FitEdmd
from koopcli.errors import InvalidValueError
from koopcli.koopman import edmd
from koopcli.koopman.bases import BASES
from koopcli.koopman.predictor import Predictor
from koopcli.records import Trajectories
from koopcli.stages.base import Context, Cost, Inputs, Prospect, Stage, Task
from koopcli.stages.predictors import describe, figures
from koopcli.store.files import size_text
from koopcli.vehicles.plants import PLANTS

FUNCTIONS_LIMIT = 4096


def _run(settings: FitEdmd, inputs: Inputs, context: Context) -> Predictor:
    trajectories: Trajectories = inputs["trajectories"]
    basis = edmd.basis_from_data(trajectories, settings.basis, settings.order)
    predictor = edmd.fit(trajectories, basis, context.progress)
    if predictor.rank < predictor.directions:
        context.warn(
            f"the data determine {predictor.rank} of {predictor.directions} directions (condition "
            f"{predictor.condition:.1e}); the others were set to zero: sample more states or inputs, or lower the order"
        )
    still = [name for name, b in zip(predictor.input_channels.names, predictor.B.T, strict=True) if not b.any()]
    if still:
        context.warn(
            f"{', '.join(still)} never moved in these data, so B is zero there: the predictor knows nothing of it"
        )
    return predictor


def _functions(task: Task) -> int:
    return BASES[task.settings.basis].count(task.settings.order, len(PLANTS[_plant(task)].states))


def _plant(task: Task) -> str:
    simulation = task.find("simulate")
    return simulation.settings.plant if simulation is not None else "forces"


def _prospect(task: Task) -> Prospect:
    settings, sample = task.settings, task.find("sample")
    about = "other data"
    if sample is not None:
        drawn = sample.settings
        about = f"{drawn.draw} {drawn.seed}" if isinstance(drawn, GridSample) else drawn.kind
    if settings.basis == "states":
        return Prospect(_functions(task), None, "DMD", about)
    return Prospect(_functions(task), None, f"EDMD, order {settings.order}", about, settings.order)


def _check(task: Task) -> None:
    order, N = task.settings.order, _functions(task)
    if N > FUNCTIONS_LIMIT:
        raise InvalidValueError(
            f"'fit-edmd.order' {order} needs {N:,} functions and {size_text(8.0 * N**2)} for A alone; "
            f"the limit is {FUNCTIONS_LIMIT:,} functions: lower the order"
        )
    sample = task.find("sample")
    too_few = sample is not None and isinstance(sample.settings, GridSample) and order >= sample.settings.count
    if sample is not None and too_few and task.settings.basis != "states":
        count = sample.settings.count
        raise InvalidValueError(
            f"'fit-edmd.order' {order} is too high for {count} values per state, which carry orders up to "
            f"{count - 1}: lower the order or raise sample.count"
        )


def _estimate(task: Task) -> Cost:
    N = _functions(task)
    sample, plant = task.ancestor("sample").settings, task.ancestor("simulate").settings
    samples = sample.trajectories * plant.steps
    crossed = isinstance(sample, GridSample) and plant.steps == 1
    states = samples // (len(sample.levels) * sample.columns) if crossed else 2 * samples
    return Cost(1e-6 * samples + 5e-11 * states * N**2 + 1.5e-9 * N**3, 8.0 * N**2)


STAGE = Stage(
    name="fit-edmd",
    version=2,
    settings=lambda values: build(FitEdmd, values),
    run=_run,
    unpack=Predictor.unpack,
    figures=figures,
    describe=describe,
    check=_check,
    estimate=_estimate,
    predicts=_prospect,
)
