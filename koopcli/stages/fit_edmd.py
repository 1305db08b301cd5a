"""Stage ``fit-edmd``: a predictor from trajectories by EDMD."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields

from koopcli.checks import build
from koopcli.config.samples import GridSample
from koopcli.config.settings import OF_BASIS, FitEdmd, Simulate
from koopcli.errors import InvalidValueError
from koopcli.koopman import stored
from koopcli.koopman.bases import BASES, Basis, Choice
from koopcli.koopman.bases.polynomial import FAMILIES
from koopcli.koopman.bases.thin_plate import ThinPlate
from koopcli.koopman.edmd import fit as edmd
from koopcli.koopman.edmd.blockwise import PASSES
from koopcli.koopman.edmd.passes import Found, Pass, pack_found, unpack_found
from koopcli.koopman.edmd.survey import Survey, survey
from koopcli.koopman.edmd.transitions import Transitions
from koopcli.koopman.predictor.coverage import coverage_of
from koopcli.koopman.predictor.predictor import Predictor
from koopcli.progress import Progress
from koopcli.records import Meta, Packed
from koopcli.stages.base import Context, Cost, Inputs, Outlook, Stage, Task
from koopcli.stages.predictors import figures, regression, size
from koopcli.stages.usable import finished, roles_of
from koopcli.store.files import size_text
from koopcli.vehicles.plants import PLANTS

TERMS_LIMIT = 4096  # coefficients of one lifted state
HARMLESS = 1e14  # a condition number that leaves two digits
ROLLED = {"linear": 0, "bilinear": 1, "generator": 10}  # about how many products with every matrix a step takes
OF_ONE_RUN = ("steps", "chunk", "reference")  # settings of a simulation that make it no other plant


def _run(settings: FitEdmd, inputs: Inputs, context: Context) -> Predictor:
    data = Transitions.of([finished(inputs[role], context) for role in roles_of(inputs)])

    def over(work: Pass) -> Iterator[Found]:
        yield from map(unpack_found, context.chunks(len(data), settings.chunk, work.pack(), work.bytes))

    plain = settings.solver == "cholesky-monomials"
    seen = survey(data, over)
    basis = edmd.basis_from_data(data, _choice(settings), seen)
    _warn_of_centres(basis, seen, context)
    method = edmd.Method(settings.terms != "linear", settings.ridge, plain, settings.terms == "generator")
    predictor = edmd.fit(data, basis, method, context.progress, over, seen)
    found = predictor.regression
    if found.rank < found.directions:
        because = edmd.why_deficient(data, predictor, seen)
        context.warn(
            f"the data determine {found.rank} of {found.directions} directions (condition "
            f"{found.condition:.1e}){f' because {because}' if because else ''}; the others were set to zero: "
            "sample more states or inputs, lower the order or the number of centres, or use a --ridge"
        )
    elif plain and found.condition > HARMLESS:
        context.warn(
            f"the normal equations of raw monomials have condition {found.condition:.1e}, squared: what this "
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


def _choice(settings: FitEdmd) -> Choice:
    return Choice(
        settings.basis,
        settings.order,
        settings.degree_velocity,
        settings.solver == "cholesky-monomials",
        settings.centres,
        settings.placement,
        settings.seed,
    )


def _functions(task: Task) -> int:
    return BASES[task.settings.basis].count(_choice(task.settings), len(PLANTS[_plant(task)].states))


def _terms(task: Task) -> int:
    """Coefficients of each lifted state."""
    n_u = len(PLANTS[_plant(task)].inputs)
    return _functions(task) * (1 + n_u) if task.settings.terms != "linear" else _functions(task) + n_u


def _plant(task: Task) -> str:
    simulation = task.find("simulate")
    return simulation.settings.plant if simulation is not None else "forces"


def _outlook(task: Task) -> Outlook:
    settings, sample = task.settings, task.find("sample")
    about = "other data"
    if sample is not None:
        drawn = sample.settings
        about = f"{drawn.draw} {drawn.seed}" if isinstance(drawn, GridSample) else drawn.kind
    name = NAMES[settings.basis].format(**vars(settings))
    if settings.terms != "linear":
        name = f"bilinear {name}" if settings.terms == "bilinear" else f"bilinear {name}, generator"
    order = settings.order if "order" in OF_BASIS[settings.basis] else None
    rolling = 2.5e-10 * _functions(task) * _terms(task) * ROLLED[settings.terms]
    return Outlook(_functions(task), None, name, about, order, a_state=rolling)


NAMES = {
    "tensor": "EDMD, order {order}",
    "total": "EDMD, total degree {order}",
    "anisotropic": "EDMD, degrees {degree_velocity} and {order}",
    "thin-plate": "EDMD, {centres} splines",
    "states": "DMD",
}


def _check(task: Task) -> None:
    settings, N = task.settings, _functions(task)
    lower = "fit-edmd.centres" if settings.basis == "thin-plate" else "fit-edmd.order"
    if _terms(task) > TERMS_LIMIT:
        raise InvalidValueError(
            f"'{lower}' {getattr(settings, lower.partition('.')[2])} needs {N:,} functions with {_terms(task):,} "
            f"{settings.terms} terms and {size_text(8.0 * N * _terms(task))} for them; the limit is {TERMS_LIMIT:,} "
            "terms: lower it, or choose a smaller family (--basis total, anisotropic)"
        )
    if settings.solver == "cholesky-monomials":
        if settings.basis not in FAMILIES:
            raise InvalidValueError(
                f"the solver 'cholesky-monomials' is for polynomials, not for the basis '{settings.basis}': "
                "use the solver 'orthonormal'"
            )
        if settings.ridge > 0:
            raise InvalidValueError(
                "the solver 'cholesky-monomials' shows the plain regression, without 'fit-edmd.ridge': "
                "use the solver 'orthonormal'"
            )
    if settings.terms == "generator" and settings.basis == "states":
        raise InvalidValueError("the terms 'generator' need a constant, which the basis 'states' has not: use 'total'")
    data = [task.input(role) for role in roles_of(dict(task.inputs))]
    _check_alike(data)
    if settings.basis != "thin-plate":  # whose centres need as many different states, which only data tell
        _check_samples(task, data)
    sample = task.find("sample")
    if sample is not None and isinstance(sample.settings, GridSample) and len(data) == 1:
        _check_grid(task, sample.settings)


def _check_alike(data: list[Task]) -> None:
    """Refuse several trajectories that are not of one plant and period, or one of them twice."""
    names = [f.name for f in fields(Simulate) if f.name not in OF_ONE_RUN]
    for other in data[1:]:
        differing = [name for name in names if getattr(data[0].settings, name) != getattr(other.settings, name)]
        if differing:
            raise InvalidValueError(
                f"{data[0].name} and {other.name} differ in {', '.join(differing)}: one predictor is of one plant, "
                "vehicle and sampling period, so fit them apart"
            )
    for i, one in enumerate(data):
        if one in data[:i]:
            raise InvalidValueError(f"{one.name} is named twice: its samples would count double, so name it once")


def _check_samples(task: Task, data: list[Task]) -> None:
    """Refuse fewer samples than unknowns, as far as it is known how many there will be."""
    starts = [one.find("sample") for one in data]
    if all(start is not None for start in starts):
        runs = zip(starts, data, strict=True)
        samples = sum(start.settings.trajectories * one.settings.steps for start, one in runs if start is not None)
        inputs = len(PLANTS[_plant(task)].inputs)
        edmd.check_samples(samples, _functions(task), inputs, bilinear=task.settings.terms != "linear")


def _check_grid(task: Task, grid: GridSample) -> None:
    """Refuse what the values of a grid cannot determine."""
    settings, n_x = task.settings, len(grid.box)
    highest = max(BASES[settings.basis].degrees(_choice(settings), n_x), default=0)
    if highest >= grid.count:
        name = "order" if highest == settings.order else "degree_velocity"
        raise InvalidValueError(
            f"'fit-edmd.{name}' {highest} is too high for {grid.count} values per state, which carry orders up to "
            f"{grid.count - 1}: lower the order or raise sample.count"
        )
    if settings.basis == "thin-plate" and _functions(task) > grid.count**n_x:
        raise InvalidValueError(
            f"'fit-edmd.centres' {settings.centres} is too many for {grid.count**n_x:,} different states: lower it or "
            "raise sample.count"
        )


def _estimate(task: Task) -> Cost:
    N, terms = _functions(task), _terms(task)
    data = [task.input(role) for role in roles_of(dict(task.inputs))]
    samples = sum(one.ancestor("sample").settings.trajectories * one.settings.steps for one in data)
    sample, steps = data[0].ancestor("sample").settings, data[0].settings.steps
    crossed = isinstance(sample, GridSample) and steps == 1 and task.settings.solver == "orthonormal" and len(data) == 1
    rows = samples // (len(sample.levels) * sample.columns) if crossed else 2 * samples
    lifting = (1e-8 * task.settings.centres if task.settings.basis == "thin-plate" else 1e-6) * samples
    return Cost(lifting + 5e-11 * rows * N * terms + 1.5e-9 * N**3, 8.0 * N * terms)


def _describe(figures: Meta, settings: FitEdmd) -> str:
    found = f"{size(figures)}; {regression(figures)}, condition {figures['condition']:.2g}"
    return f"{found}, solved by {figures['solved_by']}" if figures["solved_by"] else found


STAGE = Stage(
    name="fit-edmd",
    version=5,
    settings=lambda values: build(FitEdmd, values),
    run=_run,
    unpack=stored.predictor,
    figures=figures,
    describe=_describe,
    check=_check,
    estimate=_estimate,
    chunk=_chunk,
    predicts=_outlook,
)
