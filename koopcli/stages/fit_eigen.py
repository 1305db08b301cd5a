"""Stage ``fit-eigen``: a predictor from trajectories by eigenfunctions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from koopcli.checks import build
from koopcli.config.settings import PAIRS, FitEigen
from koopcli.errors import InvalidValueError
from koopcli.koopman import stored
from koopcli.koopman.eigen import fit as eigenfunctions
from koopcli.koopman.eigen.fit import Reading
from koopcli.koopman.eigen.frames import check_frame
from koopcli.koopman.eigen.futures import Futures
from koopcli.koopman.eigen.rates import Spectrum
from koopcli.koopman.eigen.recurrence import Surface, check_recurrence, check_starts
from koopcli.koopman.eigen.tabulated import Tabulated
from koopcli.koopman.predictor.predictor import Predictor
from koopcli.koopman.scores.metrics import summary
from koopcli.records import FloatArray, Meta, Trajectories
from koopcli.stages.base import Context, Cost, Inputs, Outlook, Stage, Task, refuse_beyond_memory
from koopcli.stages.predictors import figures, regression, size
from koopcli.stages.usable import finished
from koopcli.vehicles.plants import PLANTS, remembered_plant
from koopcli.vehicles.symmetry import images

SEVERAL = "where trajectories from several energies meet, an eigenfunction has several values, and the lift blends them"


def _run(settings: FitEigen, inputs: Inputs, context: Context) -> Predictor:
    trajectories = finished(inputs["trajectories"], context)
    context.progress(0, 2)
    x = eigenfunctions.autonomous(trajectories)
    _check_surface(x, trajectories, context)
    context.progress(1, 2)
    trajectories = replace(trajectories, x=x)  # not read again
    plant = remembered_plant(trajectories.plant) if settings.mirror else None
    signs = [] if plant is None else images(settings.mirror, plant.parameters, plant.states.names)
    complete = eigenfunctions.with_images(trajectories, signs)
    how = reading(settings, trajectories.steps, trajectories.dt)
    return eigenfunctions.fit(complete, how, 1 + len(signs), context.progress)


def reading(settings: FitEigen, steps: int, dt: float) -> Reading:
    """The settings of a fit in steps of ``dt`` s, of trajectories of so many ``steps``."""
    s = settings
    tabulated = _whole("tabulate", s.tabulate, dt)
    horizon = steps - tabulated if s.horizon is None else _whole("horizon", s.horizon, dt)
    assert s.pairs is not None or s.eigenvalues == "dmd", "settled"
    return Reading(
        spectrum=_spectrum(s),
        window=s.window,
        boundary=s.boundary,
        centres=s.centres,
        seed=s.seed,
        scaling=s.scaling,
        cut=s.cut,
        tabulated=tabulated,
        horizon=horizon,
        lift=s.lift,
        frame=s.coordinates,
        power=s.radial_power,
        neighbours=s.neighbours,
        nodes=s.nodes,
        spacing=s.spacing,
        rounds=s.rounds,
        trust=s.trust,
    )


def _spectrum(s: FitEigen) -> Spectrum:
    return Spectrum(s.eigenvalues, s.degree, s.pairs or 0, s.lowest, s.highest, s.damping)


def _figures(predictor: Predictor) -> Meta:
    lift, trust = predictor.observables, predictor.trust
    assert isinstance(lift, (Tabulated, Futures))
    modes = lift.modes
    return {
        **figures(predictor),
        "rates": modes.rates.real.tolist(),
        "frequencies": modes.rates.imag.tolist(),
        "modes": len(modes.rates),
        "missed": predictor.regression.missed,
        "nodes": len(lift.nodes.kept),
        "beyond": f"predictions from outside the hull of the data {predictor.beyond}",
        "trust": None if trust is None else {"level": trust.level, **summary(trust.errors)},
    }


def _describe(figures: Meta, settings: FitEigen) -> str:
    found = f"{size(figures)}; {figures['modes']} modes represent the data to {figures['missed']:.2g} %"
    if figures["trust"] is not None:
        found += f"; median error in cross-validation {figures['trust']['median']:.2g} %"
    cut = "rounding" if settings.cut is None else f"{settings.cut:g}"
    return f"{found}; {regression(figures)} at cut {cut}"


def _check_surface(x: FloatArray, trajectories: Trajectories, context: Context) -> None:
    """The method's assumption: a surface of initial states that no trajectory comes back to."""
    repeated = check_starts(x)
    if repeated:
        context.warn(
            f"{repeated} of {len(x)} initial states are repeated; they are kept and count as often as they come"
        )
    surface = None
    if trajectories.plant:
        plant, u = remembered_plant(trajectories.plant), np.asarray(trajectories.u[0])[:1]
        surface = Surface(plant.kinetic_energy, lambda states: plant.rhs(states, np.repeat(u, len(states), axis=0)))
    levels = check_recurrence(x, trajectories.dt, surface)
    if levels is None:
        context.warn(
            "the initial states are no surface of one kinetic energy, so that trajectories may lead through it again "
            f"was only checked at these states themselves; {SEVERAL}"
        )
    elif levels > 1:
        context.warn(f"no trajectory comes back to its own one of the {levels} surfaces of kinetic energy; {SEVERAL}")


def _whole(name: str, seconds: float, dt: float) -> int:
    """A time in steps."""
    steps = seconds / dt
    if abs(steps - round(steps)) > 1e-6 * steps or round(steps) < 1:
        raise InvalidValueError(
            f"'fit-eigen.{name}' must be a whole number of sampling periods of {dt:g} s, got {seconds:g} s"
        )
    return round(steps)


def _check(task: Task) -> None:
    simulation, sample = task.find("simulate"), task.find("sample")
    if sample is not None and sample.settings.driven:
        kind = sample.settings.kind
        calm = "leave its inputs out with --set sample.excitation=none" if kind == "drive" else "use kind 'ellipsoid'"
        raise InvalidValueError(
            f"a sample of kind '{kind}' drives its trajectories with inputs that change, and an "
            f"eigenfunction e^(λt) g(x0) belongs to a system that runs by itself: {calm}, or fit with fit-edmd"
        )
    if simulation is None:
        return
    plant, fit = simulation.settings, task.settings
    found = reading(fit, plant.steps, plant.dt)
    if fit.eigenvalues in PAIRS and fit.pairs > 1 and fit.lowest >= fit.highest:
        raise InvalidValueError(
            f"'fit-eigen.lowest' {fit.lowest:g} rad/s must be below 'fit-eigen.highest' {fit.highest:g} rad/s"
        )
    if fit.rounds and fit.horizon is None:
        raise InvalidValueError("'fit-eigen.rounds' continues trajectories over the horizon: set fit-eigen.horizon too")
    eigenfunctions.check_window(plant.steps, found, plant.dt)
    n_x = len(PLANTS[plant.plant].states)
    eigenfunctions.check_modes(found.spectrum.count(n_x), found.horizon if fit.window == "horizon" else plant.steps)
    check_frame(fit.coordinates, PLANTS[plant.plant].states)
    images(fit.mirror, plant.vehicle, PLANTS[plant.plant].states.names)
    if sample is not None:
        splines = 32.0 * sample.settings.trajectories * task.settings.centres  # distances, splines, and their factors
        needed = splines if task.settings.boundary == "thin-plate" else 0.0
        refuse_beyond_memory("the fit", needed + 3 * _estimate(task).bytes, "fit-eigen.centres or sample.count")


def _outlook(task: Task) -> Outlook:
    simulation, sample = task.find("simulate"), task.find("sample")
    n_x = len(PLANTS[simulation.settings.plant].states) if simulation is not None else 3
    fit = task.settings
    copies, about = n_x, f"eigenfunctions, {fit.boundary if fit.window == 'trajectory' else fit.lift}"
    if fit.boundary == "thin-plate":
        starts = sample.settings.trajectories if sample is not None else task.settings.centres
        copies = min(starts, task.settings.centres)
    horizon = None
    if simulation is not None:
        found = reading(fit, simulation.settings.steps, simulation.settings.dt)
        eigenfunctions.check_window(simulation.settings.steps, found, simulation.settings.dt)
        horizon = found.horizon
    return Outlook(copies * _spectrum(fit).count(n_x), horizon, about)


def _estimate(task: Task) -> Cost:
    simulation, sample = task.ancestor("simulate").settings, task.ancestor("sample").settings
    J, functions = sample.trajectories, _outlook(task).functions
    wide = task.settings.centres if task.settings.boundary == "thin-plate" else 1
    table = 3 * J * (1 + round(task.settings.tabulate / simulation.dt))
    seconds = 0.3 + 2e-9 * J * wide * min(J, wide) + 1e-9 * J * simulation.steps * min(J, wide)
    copies = 2 ** len(task.settings.mirror)
    if task.settings.window == "horizon":
        seconds, table = seconds + 3.0 * task.settings.trust, copies * 3 * J * (simulation.steps + 1)
    return Cost(seconds, 8.0 * (2 * copies * table + J * min(J, wide) + 7 * functions))


STAGE = Stage(
    name="fit-eigen",
    version=3,
    settings=lambda values: build(FitEigen, values),
    run=_run,
    unpack=stored.predictor,
    figures=_figures,
    describe=_describe,
    check=_check,
    estimate=_estimate,
    predicts=_outlook,
)
