"""A small log with every defect that is common in logs, from the plant on wheels; what was really driven is known.

``python -m koopcli.logs.defects FOLDER`` writes it. What is wrong with it stands in its README.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from koopcli.records import FloatArray
from koopcli.simulation.integrate import integrate
from koopcli.vehicles.handling import steady_steer
from koopcli.vehicles.parameters import MagicFormula, VehicleParameters
from koopcli.vehicles.plants.wheels import TorqueInput

CAR = VehicleParameters(  # of the middle class; its motors turn with its wheels, so J_R is large
    m=1300.0,
    Jzz=1900.0,
    l_f=1.2,
    l_r=1.4,
    c_w=0.3,
    A=2.1,
    rho=1.2,
    J_R=2.5,
    r_w=0.32,
    lateral=MagicFormula(10.0, 1.4, 1.0, 0.0),
    longitudinal=MagicFormula(8.0, 1.6, 1.1, 0.4),
)
WHEELBASE = CAR.l_f + CAR.l_r  # m
MOTION_STEP, CONTROL_STEP = 0.01, 0.02  # s
PARTS, PART = 4, 26.0  # parts of the drive, s each
GAP = 26.0  # s, in which nothing was recorded
LATE = 0.2  # s, by which the clock of the controls runs ahead: what they say seems to happen too late
RATIO = 16.0  # of the steering
KMH, DEGREES = 3.6, 180 / np.pi
NOISE = 0.02  # standard deviation, in km/h and deg/s
SLOWEST, FASTEST = 9.0, 25.0  # m/s
KNOT = 3.25  # s between changes of the torque
LATERAL = 3.5  # m/s², the most that the steer asks for
SEED = 1
MOTION, CONTROLS = "motion.csv", "controls.csv"


@dataclass(frozen=True, eq=False)
class Drive:
    """What was driven: ``x`` (parts, rows, 3) with v_x, v_y in m/s and yaw_rate in rad/s every ``MOTION_STEP`` s,
    ``u`` (parts, steps, 2) with the steer of the front wheels in rad and the sum of all wheels' torques in N m, each
    held for ``CONTROL_STEP`` s; ``starts`` (parts,): the time in s of the first row of each part.
    """

    x: FloatArray
    u: FloatArray
    starts: FloatArray


def drive(seed: int = SEED) -> Drive:
    """Drive the car for four parts of 26 s at some 8 to 25 m/s: sines and steps of steer and of torque.

    The same ``seed`` gives the same drive.
    """
    rng = np.random.default_rng(seed)
    steps = round(PART / CONTROL_STEP)
    times: FloatArray = CONTROL_STEP * np.arange(steps, dtype=np.float64)
    knots = np.arange(0.0, PART + KNOT, KNOT)
    u = np.empty((PARTS, steps, 2))
    x0 = np.zeros((PARTS, 5))
    r_w, J_R = CAR.r_w or 0.0, CAR.J_R or 0.0
    for part in range(PARTS):
        speed = np.interp(times, knots, _speeds(rng, len(knots)))
        lateral = 0.5 * _sines(rng, times, (0.11, 0.23, 0.47, 0.83), 1.2) + _held(rng, times, 3.0)
        lateral = LATERAL * np.tanh(lateral / 2)
        u[part, :, 0] = [steady_steer(CAR, v, a) for v, a in zip(speed, lateral, strict=True)]
        drag = 0.5 * CAR.c_w * CAR.rho * CAR.A * speed**2
        wanted = np.gradient(speed, CONTROL_STEP) + 0.5 * _sines(rng, times, (0.4, 0.9), 1.0)
        u[part, :, 1] = r_w * ((CAR.m + 4 * J_R / r_w**2) * wanted + drag)
        x0[part] = [speed[0], 0.0, 0.0, speed[0] / r_w, speed[0] / r_w]
    plant = TorqueInput(CAR)
    inputs = np.zeros((PARTS, steps, 6))
    inputs[..., 0], inputs[..., 1], inputs[..., 4] = u[..., 0], u[..., 1] / 4, u[..., 1] / 4
    inputs = np.repeat(inputs, round(CONTROL_STEP / MOTION_STEP), axis=1)
    x, _ = integrate(plant.rhs, x0, inputs, MOTION_STEP, fastest_rate=plant.fastest_rate)
    return Drive(x[..., :3], u, (PART + GAP) * np.arange(PARTS, dtype=np.float64))


def write_defective_log(folder: Path, seed: int = SEED) -> list[Path]:
    """Write what :func:`drive` gives as two files into ``folder``, with all that their README lists; their paths.

    Raises ``OSError`` where they cannot be written.
    """
    driven = drive(seed)
    rng = np.random.default_rng(seed + 1)
    motion = ["time [s],speed [km/h],v_lat [m/s],gyro_z [deg/s]", "4711.37,31.2,0,-4.5"]
    controls = ["t,steering_wheel_angle (deg),torque_Nm"]
    for start, x, u in zip(driven.starts, driven.x, driven.u, strict=True):
        noise = NOISE * rng.standard_normal((len(x), 2))
        speed, rate = KMH * x[:, 0] + noise[:, 0], -DEGREES * x[:, 2] + noise[:, 1]
        times = start + MOTION_STEP * np.arange(len(x))
        motion += [f"{t:.2f},{v:.4f},0,{r:.4f}" for t, v, r in zip(times, speed, rate, strict=True)]
        times = start + LATE + CONTROL_STEP * np.arange(len(u))
        angle = DEGREES * RATIO * u[:, 0]
        controls += [f'"{t:.2f},{a:.4f},{torque:.2f}"' for t, a, torque in zip(times, angle, u[:, 1], strict=True)]
    folder.mkdir(parents=True, exist_ok=True)
    files = [folder / MOTION, folder / CONTROLS]
    for file, lines in zip(files, (motion, controls), strict=True):
        file.write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")
    return files


def _speeds(rng: np.random.Generator, count: int) -> FloatArray:
    """Speeds in m/s at the knots: a walk of at most 6 m/s a knot within the slowest and the fastest."""
    speeds = [rng.uniform(SLOWEST, FASTEST)]
    while len(speeds) < count:
        low, high = max(SLOWEST, speeds[-1] - 6.0), min(FASTEST, speeds[-1] + 6.0)
        speeds.append(rng.uniform(low, high))
    return np.array(speeds)


def _sines(rng: np.random.Generator, times: FloatArray, frequencies: tuple[float, ...], height: float) -> FloatArray:
    """The sum of a sine at each of ``frequencies`` in Hz with a phase of its own, each of ``height``."""
    phases = rng.uniform(0, 2 * np.pi, len(frequencies))
    waves: FloatArray = np.sin(2 * np.pi * np.outer(times, frequencies) + phases)
    total: FloatArray = height * waves.sum(axis=1)
    return total


def _held(rng: np.random.Generator, times: FloatArray, length: float) -> FloatArray:
    """Levels between -3 and 3, each held for about ``length`` s."""
    levels = rng.uniform(-3, 3, len(times))
    changes = np.cumsum(rng.uniform(0.5 * length, 1.5 * length, len(times)))
    held: FloatArray = levels[np.searchsorted(changes, times)]
    return held


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python -m koopcli.logs.defects FOLDER")
    for path in write_defective_log(Path(sys.argv[1])):
        print(path)
