"""Stage ``fit-edmd``: a predictor from trajectories by EDMD."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import fields

from koopcli.checks import restored
from koopcli.config.settings import Simulate
from koopcli.errors import InvalidValueError
from koopcli.koopman import stored
from koopcli.koopman.bases.basis import Basis, BasisChoice
from koopcli.koopman.bases.polynomial import Polynomials
from koopcli.koopman.bases.thin_plate import ThinPlate
from koopcli.koopman.edmd import fit as edmd
from koopcli.koopman.edmd.blockwise import PASSES
from koopcli.koopman.edmd.fit import FitEdmd
from koopcli.koopman.edmd.passes import Found, Pass, pack_found, unpack_found
from koopcli.koopman.edmd.survey import Survey, survey
from koopcli.koopman.edmd.transitions import Transitions
from koopcli.koopman.predictor.coverage import coverage_of
from koopcli.koopman.predictor.predictor import Predictor
from koopcli.logs.imported import Log
from koopcli.progress import Progress
from koopcli.records import Meta, Packed
from koopcli.simulation.samples.grid import GridSample
from koopcli.stages import logs
from koopcli.stages.base import Context, Cost, Inputs, Outlook, Stage, Task
from koopcli.stages.predictors import figures, regression, size
from koopcli.stages.roles import finished, roles_of
from koopcli.store.files import size_text
from koopcli.vehicles.plants.forces import Forces
from koopcli.vehicles.plants.plant import PlantChoice

TERMS_LIMIT = 4096  # coefficients of one lifted state
HARMLESS = 1e14  # a condition number that leaves two digits
UNKNOWN_DT = 0.04  # s, of a log that tells it itself
OF_ONE_RUN = ("steps", "chunk", "reference")  # settings of a simulation that make it no other plant


def _run(settings: FitEdmd, inputs: Inputs, context: Context) -> Predictor:
    measured = [inputs[role].episodes for role in roles_of(inputs) if isinstance(inputs[role], Log)]
    if measured:
        predictor = edmd.fit_measured(measured, settings, context.progress)
        for note in predictor.regression.notes:
            context.warn(note)
        return predictor
    data = Transitions.of([finished(inputs[role], context) for role in roles_of(inputs)])

    def over(work: Pass) -> Iterator[Found]:
        yield from map(unpack_found, context.chunks(len(data), settings.chunk, work.pack(), work.bytes))

    seen = survey(data, over)
    basis = settings.basis_from(data, seen)
    _warn_of_centres(basis, seen, context)
    predictor = edmd.fit(data, basis, settings, context.progress, over, seen)
    regression = predictor.regression
    if regression.rank < regression.directions:
        because = edmd.why_deficient(data, predictor, seen)
        context.warn(
            f"the data determine {regression.rank} of {regression.directions} directions (condition "
            f"{regression.condition:.1e}){f' because {because}' if because else ''}; the others were set to zero: "
            "sample more states or inputs, lower the order or the number of centres, or use a --ridge"
        )
    elif settings.plain and regression.condition > HARMLESS:
        context.warn(
            f"the normal equations of raw monomials have condition {regression.condition:.1e}, squared: what this "
            "predictor shows is rounding as much as the method; use the solver 'orthonormal'"
        )
    acting = predictor.dynamics.acting
    still = [name for name, acts in zip(predictor.input_channels.names, acting, strict=True) if not acts]
    if still:
        context.warn(
            f"{', '.join(still)} never moved in these data, so B is zero there: the predictor knows nothing of it; "
            "sample inputs that move (sample.levels)"
        )
    return predictor


def _chunk(settings: FitEdmd, inputs: Inputs, rows: slice, progress: Progress) -> Packed:
    """What the pass that is given finds in some of the samples."""
    given: Packed = inputs["given"]
    data = Transitions.of([inputs[role].finished() for role in roles_of(inputs)])
    return pack_found(PASSES[given.meta["kind"]](given)(data, rows, progress))


def _warn_of_centres(basis: Basis, seen: Survey, context: Context) -> None:
    if isinstance(basis, ThinPlate):
        outside = int(coverage_of(seen.states, seen.corners).outside(basis.centres).sum())
        if outside:
            context.warn(
                f"{outside} of {len(basis.centres)} centres lie outside the data, where splines only grow: "
                "--placement k-means keeps them inside"
            )


def _functions(task: Task) -> int:
    states, inputs, dt = _channels(task)
    memory = task.settings.memory
    if memory is None:
        memory = edmd.MEMORY if _measured(task) else 0.0
    return int(task.settings.basis.functions(states)) + int(memory / dt + 0.5) * (states + inputs)


def _terms(task: Task) -> int:
    """Coefficients of each lifted state."""
    return int(task.settings.terms.count(_functions(task), _channels(task)[1]))


def _channels(task: Task) -> tuple[int, int, float]:
    """The number of states and of inputs of the data, and their sampling period in s as far as it is known."""
    log, simulation = task.find(logs.STAGE_NAME), task.find("simulate")
    if log is not None:
        return (*logs.channels(log), log.settings.dt or UNKNOWN_DT)
    plant: PlantChoice | type[PlantChoice] = simulation.settings.plant if simulation is not None else Forces
    return len(plant.states), len(plant.inputs), simulation.settings.dt if simulation is not None else UNKNOWN_DT


def _measured(task: Task) -> bool:
    return task.find(logs.STAGE_NAME) is not None


def _outlook(task: Task) -> Outlook:
    settings, sample = task.settings, task.find("sample")
    about = "a log" if _measured(task) else "other data"
    if sample is not None:
        about = sample.settings.label
    name = settings.terms.label.format(settings.basis.name)
    order = getattr(settings.basis, "order", None)
    rolling = 2.5e-10 * _functions(task) * _terms(task) * settings.terms.rolled
    return Outlook(_functions(task), None, name, about, order, a_state=rolling)


def _check(task: Task) -> None:
    settings, N = task.settings, _functions(task)
    if _terms(task) > TERMS_LIMIT:
        raise InvalidValueError(
            f"{_size(settings.basis)} needs {N:,} functions with {_terms(task):,} "
            f"{settings.terms.kind} terms and {size_text(8.0 * N * _terms(task))} for them; the limit is "
            f"{TERMS_LIMIT:,} terms: lower it, or choose a smaller family (--basis total, anisotropic)"
        )
    if settings.plain:
        if not isinstance(settings.basis, Polynomials):
            raise InvalidValueError(
                f"the solver 'cholesky-monomials' is for polynomials, not for the basis '{settings.basis.kind}': "
                "use the solver 'orthonormal'"
            )
        if settings.ridge > 0:
            raise InvalidValueError(
                "the solver 'cholesky-monomials' shows the plain regression, without 'fit-edmd.ridge': "
                "use the solver 'orthonormal'"
            )
    if settings.terms.needs_constant and settings.basis.makes.constant is None:
        raise InvalidValueError(
            f"the terms '{settings.terms.kind}' need a constant, which the basis '{settings.basis.kind}' has not: "
            "use 'total'"
        )
    data = [task.input(role) for role in roles_of(dict(task.inputs))]
    _check_once(data)
    if _measured(task):
        _check_measured(data)
        edmd.check_increments(settings)
        return
    _check_alike(data)
    if not settings.basis.of_states:
        _check_samples(task, data)
    sample = task.find("sample")
    if sample is not None and isinstance(sample.settings, GridSample) and len(data) == 1:
        _check_grid(task, sample.settings)


def _size(basis: BasisChoice) -> str:
    """What makes a basis large, with its value."""
    return (
        f"'fit-edmd.{basis.sized_by}' {getattr(basis, basis.sized_by)}"
        if basis.sized_by
        else f"the basis '{basis.kind}'"
    )


def _check_alike(data: list[Task]) -> None:
    """Refuse several trajectories that are not of one plant and period."""
    names = [f.name for f in fields(Simulate) if f.name not in OF_ONE_RUN]
    for task in data[1:]:
        differing = [name for name in names if getattr(data[0].settings, name) != getattr(task.settings, name)]
        if differing:
            raise InvalidValueError(
                f"{data[0].name} and {task.name} differ in {', '.join(differing)}: one predictor is of one plant, "
                "vehicle and sampling period, so fit them apart"
            )


def _check_measured(data: list[Task]) -> None:
    """Refuse logs and simulated trajectories together."""
    for task in data:
        if task.stage != logs.STAGE_NAME:
            raise InvalidValueError(f"{task.name} is simulated, and the others are logs: fit them apart")


def _check_once(data: list[Task]) -> None:
    """Refuse one of several data twice."""
    for i, task in enumerate(data):
        if task in data[:i]:
            raise InvalidValueError(f"{task.name} is named twice: its samples would count double, so name it once")


def _check_samples(task: Task, data: list[Task]) -> None:
    """Refuse fewer samples than unknowns, as far as it is known how many there will be."""
    starts = [run.find("sample") for run in data]
    if all(start is not None for start in starts):
        runs = zip(starts, data, strict=True)
        samples = sum(start.settings.trajectories * run.settings.steps for start, run in runs if start is not None)
        inputs = _channels(task)[1]
        edmd.check_samples(samples, _functions(task), inputs, task.settings.terms)


def _check_grid(task: Task, grid: GridSample) -> None:
    """Refuse what the values of a grid cannot determine."""
    settings, n_x = task.settings, len(grid.box)
    highest = max(settings.basis.degrees(n_x), default=0)
    if highest >= grid.count:
        name = "order" if highest == getattr(settings.basis, "order", None) else "degree_velocity"
        raise InvalidValueError(
            f"'fit-edmd.{name}' {highest} is too high for {grid.count} values per state, which carry orders up to "
            f"{grid.count - 1}: lower the order or raise sample.count"
        )
    if settings.basis.of_states and _functions(task) > grid.count**n_x:
        raise InvalidValueError(
            f"{_size(settings.basis)} is too many for {grid.count**n_x:,} different states: lower "
            "it or raise sample.count"
        )


def is_product(settings: FitEdmd, data: Sequence[Task]) -> bool:
    """Whether the fit averages over the inputs of a product of states with inputs, which is read at once."""
    sample = data[0].find("sample")
    if settings.by_increments:
        return False
    grid = sample is not None and isinstance(sample.settings, GridSample) and data[0].settings.steps == 1
    grid = grid and not data[0].settings.noise
    return grid and len(data) == 1 and not settings.plain and settings.basis.makes.constant is not None


def _estimate(task: Task) -> Cost:
    N, terms = _functions(task), _terms(task)
    if _measured(task):
        return Cost(0.3, 8.0 * N * terms)
    data = [task.input(role) for role in roles_of(dict(task.inputs))]
    samples = sum(run.ancestor("sample").settings.trajectories * run.settings.steps for run in data)
    sample = data[0].ancestor("sample").settings
    rows = samples // (len(sample.levels) * sample.columns) if is_product(task.settings, data) else 2 * samples
    return Cost(task.settings.basis.seconds * samples + 5e-11 * rows * N * terms + 1.5e-9 * N**3, 8.0 * N * terms)


def _describe(figures: Meta, settings: FitEdmd) -> str:
    text = f"{size(figures)}; {regression(figures)}, condition {figures['condition']:.2g}"
    return f"{text}, solved by {figures['solved_by']}" if figures["solved_by"] else text


STAGE = Stage(
    name="fit-edmd",
    version=7,
    settings=lambda values: restored(FitEdmd, values),
    run=_run,
    unpack=stored.predictor,
    figures=figures,
    describe=_describe,
    check=_check,
    estimate=_estimate,
    chunk=_chunk,
    predicts=_outlook,
)
