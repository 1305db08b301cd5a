"""Predictors that drive beside the true car: what their states make of one set of inputs, as paths on the road."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from koopcli.config.experiment import Experiment
from koopcli.errors import InvalidValueError
from koopcli.koopman.eigen.frames import yaw
from koopcli.records import FloatArray
from koopcli.reproduction.edmd_cells import Edmd
from koopcli.reproduction.report import Race
from koopcli.simulation.integrate import simulate
from koopcli.stages.pipeline import Pipeline
from koopcli.vehicles.handling import G
from koopcli.vehicles.parameters import VehicleParameters
from koopcli.vehicles.plants import remembered_plant
from koopcli.vehicles.plants.forces import ForceInput

SECONDS, SPEED = 0.8, 20.0  # of the swerve; s, m/s
SIDEWAYS = 0.9 * G  # largest lateral acceleration, m/s²
INSIDE = 0.7  # of the half-widths of the training box: as far as the swerve goes
LOST = 20.0  # m from the true car, from where a ghost is shown no longer


@dataclass(frozen=True)
class Track:
    """A car's path: ``x``, ``y`` in m and heading in rad, (samples, 3), and how far it is ``off`` the true car in m.

    From where a prediction is lost on, both are not a number.
    """

    label: str
    path: FloatArray
    off: FloatArray


@dataclass(frozen=True)
class Shown:
    """The tracks of a race, the true car's first, ``dt`` s a sample; ``inputs``: what drives them, in words."""

    tracks: tuple[Track, ...]
    dt: float
    inputs: str
    vehicle: VehicleParameters


def run(race: Race, experiment: Experiment, pipeline: Pipeline) -> Shown | str:
    """What a race shows; why there is none where a predictor cannot be made."""
    try:
        predictors = [pipeline.make(task).content for _, task in race.ghosts]
        plant = remembered_plant(predictors[0].plant)
        if race.evaluation is None:
            assert isinstance(plant, ForceInput), "of the plant that is driven by forces"
            dt = predictors[0].dt
            x0, u = swerve(plant, Edmd(experiment).grid.box, dt)
            x = simulate(plant.rhs, x0[np.newaxis], u[np.newaxis], dt, fastest_rate=plant.fastest_rate)[0]
            caption = f"one swerve, by axle forces of at most {abs(u).max() / 1e3:.1f} kN"
        else:
            scores = pipeline.make(race.evaluation).content
            test = pipeline.make(race.evaluation.input("trajectories")).content
            i, dt = typical(np.asarray(scores.rmse), np.asarray(test.x[:, 0])), test.dt
            x, u = np.asarray(test.x[i]), np.asarray(test.u[i])
            caption = f"test state {i}, from which {race.ghosts[0][0]} has its mean error; the car coasts"
        labels = [label for label, _ in race.ghosts]
        predicted = [predictor.predict(x[0], u) for predictor in predictors]
    except InvalidValueError as error:
        return str(error)
    return Shown(tuple(tracks(x, dict(zip(labels, predicted, strict=True)), dt)), dt, caption, plant.parameters)


def swerve(plant: ForceInput, box: Sequence[float], dt: float) -> tuple[FloatArray, FloatArray]:
    """A first state (3,) and axle forces (steps, 4) by which a car changes its lane: one period of a sine of the yaw
    rate at a constant speed, inside the training ``box``.

    The forces are those of the equations of motion (1.1) to (1.3) along that path.
    """
    p = plant.parameters
    speed = min(SPEED, INSIDE * box[0])
    largest = min(SIDEWAYS / speed, INSIDE * box[2])
    count = max(2, round(SECONDS / dt))
    turn = 2 * math.pi / (count * dt)
    t = (np.arange(count) + 0.5) * dt  # inputs are held over a step
    yaw_rate, change = largest * np.sin(turn * t), largest * turn * np.cos(turn * t)
    across, moment = p.m * speed * yaw_rate, p.Jzz * change
    along = np.full(count, 0.5 * p.c_w * p.rho * p.A * speed**2 / 2)  # holds the speed against the air
    length = p.l_f + p.l_r
    u = np.stack([along, (p.l_r * across + moment) / length, along, (p.l_f * across - moment) / length], axis=-1)
    return np.array([speed, 0.0, 0.0]), u / plant.wheels_per_force


def typical(rmse: FloatArray, x0: FloatArray) -> int:
    """The test state (n, n_x) whose error is nearest the mean, of those that drive forwards if there are any.

    Raises ``InvalidValueError`` where every prediction diverged.
    """
    finite = np.isfinite(rmse)
    if not finite.any():
        raise InvalidValueError("every prediction diverged")
    forwards = finite & (x0[:, 0] > np.abs(x0[:, 1]))
    far = np.abs(rmse - rmse[finite].mean())
    return int(np.where(forwards if forwards.any() else finite, far, np.inf).argmin())


def tracks(x: FloatArray, predicted: dict[str, FloatArray], dt: float) -> list[Track]:
    """The true car's track and those of the ``predicted`` states (samples, n_x), seen along its first velocity."""
    start = -math.atan2(x[0, 1], x[0, 0])
    true = path(x, dt, start)
    tracks = [Track("true car", true, np.zeros(len(true)))]
    for label, states in predicted.items():
        with np.errstate(all="ignore"):
            ghost = path(states, dt, start)
            off = np.hypot(*(ghost - true)[:, :2].T)
        lost = np.logical_or.accumulate(~(off < LOST))
        tracks.append(Track(label, np.where(lost[:, np.newaxis], np.nan, ghost), np.where(lost, np.nan, off)))
    return tracks


def path(x: FloatArray, dt: float, heading: float = 0.0) -> FloatArray:
    """Position in m and heading in rad (samples, 3) of a car of the states ``x`` (samples, n_x), by the trapezoidal
    rule, from the origin at ``heading``.
    """
    angle = heading + yaw(x[np.newaxis, :, 2], dt)[0]
    c, s = np.cos(angle), np.sin(angle)
    velocity = np.stack([c * x[:, 0] - s * x[:, 1], s * x[:, 0] + c * x[:, 1]], axis=-1)
    steps = dt * (velocity[1:] + velocity[:-1]) / 2
    return np.column_stack([np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)]), angle])
