"""Stage ``fit-eigen``: a predictor from trajectories by eigenfunctions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from koopcli.checks import restored
from koopcli.errors import InvalidValueError
from koopcli.koopman import stored
from koopcli.koopman.eigen import fit as eigenfunctions
from koopcli.koopman.eigen.fit import FitEigen
from koopcli.koopman.eigen.frames import PLANAR
from koopcli.koopman.eigen.futures import Futures
from koopcli.koopman.eigen.held_back import SCORED
from koopcli.koopman.eigen.recurrence import Surface, check_recurrence, check_starts
from koopcli.koopman.eigen.smoothing import check_length, noisy, smoothed
from koopcli.koopman.eigen.tabulated import Tabulated
from koopcli.koopman.eigen.windows import COMPOSED, Ahead, AlongTrajectory
from koopcli.koopman.predictor.dynamics.force_driven import ForceDriven
from koopcli.koopman.predictor.predictor import Predictor
from koopcli.koopman.scores.metrics import summary
from koopcli.records import Channels, FloatArray, Meta, Trajectories
from koopcli.stages.base import Context, Cost, Inputs, Outlook, Stage, Task, refuse_beyond_memory
from koopcli.stages.predictors import figures, regression, size
from koopcli.stages.roles import finished
from koopcli.vehicles.plants import remembered_plant
from koopcli.vehicles.symmetry import images

A_LOOKUP = 1.5e-4  # seconds
SEVERAL = "where trajectories from several energies meet, an eigenfunction has several values, and the lift blends them"


def _run(settings: FitEigen, inputs: Inputs, context: Context) -> Predictor:
    trajectories = finished(inputs["trajectories"], context)
    context.progress(0, 2)
    x = eigenfunctions.autonomous(trajectories)
    x, settings, noise = _without_noise(x, trajectories, settings, context)
    _check_surface(x, trajectories, context)
    context.progress(1, 2)
    trajectories = replace(trajectories, x=x)  # not read again
    plant = remembered_plant(trajectories.plant) if settings.mirror else None
    signs = [] if plant is None else images(settings.mirror, plant.parameters, plant.states.names)
    complete = eigenfunctions.with_images(trajectories, signs)
    predictor = eigenfunctions.fit(complete, settings, 1 + len(signs), context.progress)
    predictor = replace(predictor, regression=replace(predictor.regression, noise=noise))
    return settings.inputs.drive(predictor, trajectories.plant)


def _without_noise(
    x: FloatArray, trajectories: Trajectories, settings: FitEigen, context: Context
) -> tuple[FloatArray, FitEigen, tuple[float, ...] | None]:
    """The states, smoothed where that is asked for or noise is seen; the settings with that settled; the deviation of
    the noise of each state.
    """
    seen = noisy(x)
    settings = replace(settings, smooth=seen if settings.smooth is None else settings.smooth)
    if not settings.smooth:
        if seen:
            context.warn("the trajectories hold noise, which is left in them: smooth them with --smooth")
        return x, settings, None
    names = trajectories.state_channels.names
    x, variance = smoothed(x, trajectories.dt, turns=names[: len(PLANAR)] == PLANAR)
    noise, motion = np.sqrt(variance.mean(axis=0)), np.sqrt((x**2).mean(axis=(0, 1)))
    for state, moved in zip(_deviations(trajectories.state_channels, noise.tolist()), motion.tolist(), strict=True):
        if state["deviation"] > moved:
            context.warn(
                f"the noise in {state['state']} ({state['deviation']:.2g} {state['unit']}) is larger than the motion "
                f"({moved:.2g} {state['unit']}): no softness of a spline helps against it; measure with less noise, or "
                "more trajectories"
            )
    return x, settings, tuple(noise.tolist())


def _figures(predictor: Predictor) -> Meta:
    lift, trust = predictor.observables, predictor.trust
    assert isinstance(lift, (Tabulated, Futures))
    modes, noise, lookup = lift.modes, predictor.regression.noise, lift.nodes.search.lift
    dynamics = predictor.dynamics
    driven = {"inputs": list(predictor.input_channels.names)} if isinstance(dynamics, ForceDriven) else {}
    return {
        **figures(predictor),
        **driven,
        "rates": modes.rates.real.tolist(),
        "frequencies": modes.rates.imag.tolist(),
        "modes": len(modes.rates),
        "missed": predictor.regression.missed,
        "nodes": len(lift.nodes.kept),
        "beyond": f"predictions from outside the hull of the data {predictor.beyond}",
        "noise": None if noise is None else _deviations(predictor.state_channels, noise),
        "softness": getattr(lookup, "softness", None),
        "trust": None if trust is None else {"level": trust.level, **summary(trust.errors)},
    }


def _deviations(states: Channels, noise: Sequence[float]) -> list[Meta]:
    every = zip(states.names, states.units, noise, strict=True)
    return [{"state": name, "unit": unit, "deviation": deviation} for name, unit, deviation in every]


def _describe(figures: Meta, settings: FitEigen) -> str:
    text = f"{size(figures)}; {figures['modes']} modes represent the data to {figures['missed']:.2g} %"
    if figures["noise"] is not None:
        deviations = ", ".join(f"{a['deviation']:.2g} {a['unit']} in {a['state']}" for a in figures["noise"])
        text += f"; noise smoothed away: {deviations}"
    if figures["softness"] is not None:
        text += f"; softness {figures['softness']:g}"
    if figures["trust"] is not None:
        text += f"; median error in cross-validation {figures['trust']['median']:.2g} %"
    if "inputs" in figures:
        text += f"; inputs: {', '.join(figures['inputs'])}"
    cut = "rounding" if settings.window.cut is None else f"{settings.window.cut:g}"
    return f"{text}; {regression(figures)} at cut {cut}"


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
    states = plant.plant.states
    fit.eigenvalues.check()
    fit.window.check(states)
    fit.check_scale(len(states))
    fit.inputs.check(isinstance(fit.window, Ahead), fit.lift, states)
    eigenfunctions.check_window(plant.steps, fit, plant.dt)
    if fit.smooth:
        check_length(plant.steps + 1)
    eigenfunctions.check_modes(fit.eigenvalues.count(len(states)), fit.window.length(fit, plant.steps, plant.dt))
    images(fit.mirror, plant.vehicle, states.names)
    if sample is not None:
        splines = 32.0 * sample.settings.trajectories * _splines(fit)  # distances, splines, and their factors
        refuse_beyond_memory("the fit", splines + 3 * _estimate(task).bytes, "fit-eigen.centres or sample.count")


def _splines(fit: FitEigen) -> int:
    """Functions of the boundary that are not one for each state."""
    return getattr(fit.window.boundary, "centres", 0) if isinstance(fit.window, AlongTrajectory) else 0


def _outlook(task: Task) -> Outlook:
    simulation, sample = task.find("simulate"), task.find("sample")
    n_x = len(simulation.settings.plant.states) if simulation is not None else 3
    fit, horizon = task.settings, None
    copies = fit.window.copies(n_x, sample.settings.trajectories if sample is not None else _splines(fit))
    if simulation is not None:
        plant = simulation.settings
        eigenfunctions.check_window(plant.steps, fit, plant.dt)
        horizon = fit.window.horizon_steps(fit, plant.steps, plant.dt)
    lift = A_LOOKUP * _lookups(fit, horizon)
    horizon = fit.inputs.horizon(horizon)
    return Outlook(copies * fit.eigenvalues.count(n_x), horizon, fit.window.name(fit), a_lift=lift)


def _lookups(fit: FitEigen, horizon: int | None) -> int:
    """Lookups of a lift that each solve for weights."""
    if not isinstance(fit.window, Ahead) or not fit.lift.counts_neighbours:
        return 0
    return 1 if fit.window.lookup_steps is None else -(-(horizon or 1) // fit.window.lookup_steps)


def _estimate(task: Task) -> Cost:
    simulation, sample = task.ancestor("simulate").settings, task.ancestor("sample").settings
    fit, J, functions = task.settings, sample.trajectories, _outlook(task).functions
    wide = max(1, _splines(fit))
    table = 3 * J * (1 + round(fit.tabulate / simulation.dt))
    seconds = 0.3 + 2e-9 * J * wide * min(J, wide) + 1e-9 * J * simulation.steps * min(J, wide)
    copies = 2 ** len(fit.mirror)
    if isinstance(fit.window, Ahead):
        a_lift = _outlook(task).a_lift
        seconds += fit.window.trust * (1.0 + SCORED * a_lift)
        smooths = bool(simulation.noise) if fit.smooth is None else fit.smooth
        seconds += smooths * len(fit.lift.softer()) * (0.5 + COMPOSED * a_lift)
        table = copies * 3 * J * (simulation.steps + 1)
    return Cost(seconds, 8.0 * (2 * copies * table + J * min(J, wide) + 7 * functions))


STAGE = Stage(
    name="fit-eigen",
    version=5,
    settings=lambda values: restored(FitEigen, values),
    run=_run,
    unpack=stored.predictor,
    figures=_figures,
    describe=_describe,
    check=_check,
    estimate=_estimate,
    predicts=_outlook,
)
