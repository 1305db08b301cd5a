"""Stage ``fit-eigen``: a predictor from trajectories by eigenfunctions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from koopcli.checks import build
from koopcli.config.samples import BoxSample, GridSample, PointSample, SampleSettings
from koopcli.config.settings import FitEigen
from koopcli.errors import InvalidValueError
from koopcli.koopman import eigenfunctions
from koopcli.koopman.modes import Modes
from koopcli.koopman.predictor import Predictor
from koopcli.koopman.recurrence import Surface, check_recurrence, check_starts
from koopcli.records import FloatArray, Meta, Trajectories
from koopcli.stages.base import Context, Cost, Inputs, Prospect, Stage, Task, refuse_beyond_memory
from koopcli.stages.predictors import describe, figures
from koopcli.vehicles.plants import PLANTS, remembered_plant


def _run(settings: FitEigen, inputs: Inputs, context: Context) -> Predictor:
    trajectories: Trajectories = inputs["trajectories"]
    context.progress(0, 2)
    x = eigenfunctions.autonomous(trajectories)
    _check_surface(x, trajectories, context)
    context.progress(1, 2)
    return eigenfunctions.fit(
        replace(trajectories, x=x),  # not read again
        degree=settings.degree,
        boundary=settings.boundary,
        centres=settings.centres,
        seed=settings.seed,
        scaling=settings.scaling,
        cut=settings.cut,
        tabulated=_tabulated(settings, trajectories.dt),
        lift=settings.lift,
    )


def _figures(predictor: Predictor) -> Meta:
    modes = predictor.A
    assert isinstance(modes, Modes)
    return {**figures(predictor), "rates": modes.rates.real.tolist(), "frequencies": modes.rates.imag.tolist()}


def _describe(figures: Meta) -> str:
    found = describe(figures)
    if figures["rank"] < figures["directions"]:
        found += f"; the errors depend on the cut, which keeps {figures['rank']} directions"
    return found


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
    if not check_recurrence(x, trajectories.dt, surface):
        context.warn(
            "the initial states are no surface of one kinetic energy, so that trajectories may lead through it again "
            "was only checked at these states themselves"
        )


def _tabulated(settings: FitEigen, dt: float) -> int:
    """Steps of each trajectory that are looked up."""
    steps = settings.tabulate / dt
    if abs(steps - round(steps)) > 1e-6 * steps or round(steps) < 1:
        raise InvalidValueError(
            f"'fit-eigen.tabulate' must be a whole number of sampling periods of {dt:g} s, got {settings.tabulate:g} s"
        )
    return round(steps)


def _check(task: Task) -> None:
    simulation, sample = task.find("simulate"), task.find("sample")
    if sample is not None and _driven(sample.settings):
        raise InvalidValueError(
            f"a sample of kind '{sample.settings.kind}' drives its trajectories with inputs that change, and an "
            "eigenfunction e^(λt) g(x0) belongs to a system that runs by itself: use a sample of kind 'ellipsoid', "
            "or fit with fit-edmd"
        )
    if simulation is None:
        return
    plant, steps = simulation.settings, simulation.settings.steps
    n_x = len(PLANTS[plant.plant].states)
    eigenfunctions.check_window(steps, _tabulated(task.settings, plant.dt), plant.dt)
    eigenfunctions.check_modes(eigenfunctions.lattice_size(n_x, task.settings.degree), steps)
    if sample is not None:
        splines = 32.0 * sample.settings.trajectories * task.settings.centres  # distances, splines, and their factors
        needed = splines if task.settings.boundary == "thin-plate" else 0.0
        refuse_beyond_memory("the fit", needed + 3 * _estimate(task).bytes, "fit-eigen.centres or sample.count")


def _driven(sample: SampleSettings) -> bool:
    """Whether the inputs of a sample change within or between its trajectories."""
    if isinstance(sample, GridSample):
        return max(sample.levels) > 0 and len(sample.levels) * sample.columns > 1
    return isinstance(sample, (BoxSample, PointSample)) and sample.excitation != "none" and sample.amplitude > 0


def _prospect(task: Task) -> Prospect:
    simulation, sample = task.find("simulate"), task.find("sample")
    n_x = len(PLANTS[simulation.settings.plant].states) if simulation is not None else 3
    copies, about = n_x, f"eigenfunctions, {task.settings.boundary}"
    if task.settings.boundary == "thin-plate":
        starts = sample.settings.trajectories if sample is not None else task.settings.centres
        copies = min(starts, task.settings.centres)
    horizon = None
    if simulation is not None:
        steps, tabulated = simulation.settings.steps, _tabulated(task.settings, simulation.settings.dt)
        eigenfunctions.check_window(steps, tabulated, simulation.settings.dt)
        horizon = steps - tabulated
    return Prospect(copies * eigenfunctions.lattice_size(n_x, task.settings.degree), horizon, about)


def _estimate(task: Task) -> Cost:
    simulation, sample = task.ancestor("simulate").settings, task.ancestor("sample").settings
    J, functions = sample.trajectories, _prospect(task).functions
    wide = task.settings.centres if task.settings.boundary == "thin-plate" else 1
    table = 3 * J * (1 + round(task.settings.tabulate / simulation.dt))
    seconds = 0.3 + 2e-9 * J * wide * min(J, wide) + 1e-9 * J * simulation.steps * min(J, wide)
    return Cost(seconds, 8.0 * (2 * table + J * min(J, wide) + 7 * functions))


STAGE = Stage(
    name="fit-eigen",
    version=1,
    settings=lambda values: build(FitEigen, values),
    run=_run,
    unpack=Predictor.unpack,
    figures=_figures,
    describe=_describe,
    check=_check,
    estimate=_estimate,
    predicts=_prospect,
)
