"""Stage ``simulate``: trajectories of a plant from a sample."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from koopcli.checks import restored
from koopcli.choices import written
from koopcli.config.settings import Simulate
from koopcli.errors import InvalidValueError
from koopcli.progress import Progress
from koopcli.records import ENDS, Course, Meta, Packed, Sample, Trajectories, join
from koopcli.simulation.integrate import STIFF, integrate
from koopcli.simulation.noise import deviations, measured
from koopcli.simulation.reference import reference
from koopcli.simulation.samples.manoeuvre import ManoeuvreSample
from koopcli.simulation.samples.sample import SampleChoice
from koopcli.stages.base import Context, Cost, Inputs, Stage, Task, refuse_beyond_memory
from koopcli.vehicles.plants.plant import Plant

A_STEP = 3e-4  # seconds for one step of a chunk, however few its trajectories are
REFERENCE_STEP = 3e-3
COURSE_BYTES = 24.0  # held of every trajectory; states and inputs are on disk, but for a chunk of them
SLOWER = 100  # by so much are chunks of the reference solver smaller


def _run(settings: Simulate, inputs: Inputs, context: Context) -> Trajectories:
    sample: Sample = inputs["sample"]
    parts = [Trajectories.unpack(part) for part in context.chunks(sample.trajectories, _rows(settings))]
    trajectories = replace(join(parts), product=None if settings.noise else sample.product)  # first states differ then
    assert trajectories.course is not None, "of what was simulated here"
    _report(trajectories.course, context)
    return trajectories


def _chunk(settings: Simulate, inputs: Inputs, rows: slice, progress: Progress) -> Packed:
    plant = _plant(settings)
    assert settings.steps is not None, "settled from the sample"
    x0, u = inputs["sample"].expand(settings.steps, rows)
    if settings.reference:
        x, course = reference(plant.rhs, x0, u, settings.dt, progress)
    else:
        x, course = integrate(plant.rhs, x0, u, settings.dt, progress, plant.fastest_rate)
    if settings.noise:
        deviation = deviations(settings.noise, plant.states)
        x = measured(x, rows.start, deviation, settings.noise_seed, settings.noise_memory)
    assert settings.plant is not None, "settled from the sample"
    own = written(settings.plant)
    about = {"plant": own.pop("kind"), **own, "vehicle": written(settings.vehicle)}
    return Trajectories(x, u, settings.dt, plant.states, plant.inputs, None, about, course).pack()


def _rows(settings: Simulate) -> int:
    """Trajectories of one chunk."""
    assert settings.chunk is not None, "settled from the plant"
    assert settings.steps is not None, "settled from the sample"
    samples = settings.chunk // (SLOWER if settings.reference else 1)
    return max(1, samples // settings.steps)


def _report(course: Course, context: Context) -> None:
    """Say which trajectories ended early. Raises ``InvalidValueError`` where none ran its whole length."""
    ended = ~course.finished
    if not ended.any():
        return
    parts = []
    for reason in np.unique(course.reason[ended]).tolist():
        rows = np.flatnonzero(course.reason == reason)
        parts.append(f"{len(rows)} of {len(ended)} {ENDS[reason]}, the first is number {rows[0]}")
    text = "; ".join(parts)
    if ended.all():
        remedy = ", or raise simulate.v_eps" if STIFF in course.reason else ", the steps or the inputs"
        raise InvalidValueError(f"no trajectory runs its whole length: {text}; lower simulate.dt{remedy}")
    context.warn(f"{text}; they are kept up to their ends, and left out of fits and scores")


def _figures(trajectories: Trajectories) -> Meta:
    product, course = trajectories.product, trajectories.course
    assert course is not None, "of what was simulated here"
    ended = {ENDS[reason]: int((course.reason == reason).sum()) for reason in np.unique(course.reason) if reason}
    most = course.substeps
    return {
        "trajectories": len(trajectories),
        "steps": trajectories.steps,
        "dt": trajectories.dt,
        "product": list(product) if product else None,
        "substeps": {"min": int(most.min()), "median": float(np.median(most)), "max": int(most.max())},
        "ended": ended,
    }


def _describe(figures: Meta, settings: Simulate) -> str:
    text = f"{figures['trajectories']} trajectories × {figures['steps']} steps of {figures['dt']} s"
    most = figures["substeps"]
    if most["max"] == 0:
        text += ", by the reference solver"
    elif most["max"] > 1:
        span = (
            f"{most['min']} to {most['max']}, median {most['median']:g}" if most["min"] < most["max"] else most["max"]
        )
        text += f", substeps at most: {span}"
    if settings.noise:
        text += f", with noise of {settings.noise:g} m/s"
    return "; ".join([text, *(f"{count} {reason}" for reason, count in figures["ended"].items())])


def _plant(settings: Simulate) -> Plant:
    assert settings.plant is not None, "settled from the sample"
    return settings.plant.of(settings.vehicle)


def _check(task: Task) -> None:
    sample, steps, plant = task.ancestor("sample").settings, task.settings.steps, task.settings.plant
    meant = sample.meant_for
    if plant.inputs != meant.inputs:
        kinds = [name for name, kind in SampleChoice.kinds().items() if isinstance(plant, kind.meant_for)]
        raise InvalidValueError(
            f"a sample of kind '{sample.kind}' holds the inputs of the plant '{meant.kind}', not of '{plant.kind}': "
            f"use a sample of kind {' or '.join(kinds)}"
        )
    _plant(task.settings)
    if isinstance(sample, ManoeuvreSample) and sample.dt != task.settings.dt:
        raise InvalidValueError(
            f"the sample holds the inputs of a manoeuvre every {sample.dt:g} s, 'simulate.dt' is "
            f"{task.settings.dt:g} s: sample again with --set simulate.dt={task.settings.dt:g}"
        )
    if sample.input_steps is not None and steps > sample.input_steps:
        raise InvalidValueError(
            f"the sample holds fresh inputs for {sample.input_steps} steps, 'simulate.steps' is {steps}: "
            "sample again with more --steps"
        )
    rows = min(_rows(task.settings), sample.trajectories)
    held = rows * _row_bytes(task.settings) + COURSE_BYTES * sample.trajectories
    refuse_beyond_memory("the trajectories", held, "the count, or simulate.chunk")


def _estimate(task: Task) -> Cost:
    n, steps = task.ancestor("sample").settings.trajectories, task.settings.steps
    each = task.settings.plant.a_sample
    if task.settings.plant.stiff:
        each *= max(1.0, task.settings.dt / 0.01)  # stiff: a longer step is walked through in more
    if task.settings.reference:
        each = REFERENCE_STEP
    turns = steps * -(-n // _rows(task.settings))
    return Cost(each * n * steps + A_STEP * turns, n * _row_bytes(task.settings))


def _row_bytes(settings: Simulate) -> float:
    """Bytes of one trajectory."""
    assert settings.plant is not None, "settled from the sample"
    assert settings.steps is not None, "settled from the sample"
    states, inputs = settings.plant.states, settings.plant.inputs
    return 8.0 * (len(states) * (settings.steps + 1) + len(inputs) * settings.steps + 3)


STAGE = Stage(
    name="simulate",
    version=4,
    settings=lambda values: restored(Simulate, values),
    run=_run,
    unpack=Trajectories.unpack,
    figures=_figures,
    describe=_describe,
    check=_check,
    estimate=_estimate,
    chunk=_chunk,
)
