"""Sampling designs. Every draw comes from one seeded generator, in a fixed order, so that a seed pins a dataset."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.records import FloatArray

SMALLEST_SHELL = 0.25  # radius of the innermost of several

Draw = Callable[["np.random.Generator", float, int], FloatArray]


def _random(generator: np.random.Generator, half_width: float, count: int) -> FloatArray:
    return np.sort(generator.uniform(-half_width, half_width, count))


def _even(generator: np.random.Generator, half_width: float, count: int) -> FloatArray:
    return np.linspace(-half_width, half_width, count)


def _chebyshev(generator: np.random.Generator, half_width: float, count: int) -> FloatArray:
    """Zeros of a Chebyshev polynomial: denser towards the ends, where a polynomial is held the least."""
    return -half_width * np.cos(np.pi * (np.arange(count) + 0.5) / count)


DRAWS: dict[str, Draw] = {"random": _random, "even": _even, "chebyshev": _chebyshev}


def grid(
    seed: int, box: Sequence[float], count: int, draw: str, levels: Sequence[float], columns: int, inputs: int
) -> tuple[tuple[FloatArray, ...], FloatArray]:
    """A product design: ``count`` values per state and ``columns`` input columns for each level F_m.

    Returns the values per state and the inputs (len(levels)·columns, 1, inputs), uniform in [-F_m, F_m].
    """
    generator = np.random.default_rng(seed)
    factors = tuple(DRAWS[draw](generator, half_width, count) for half_width in box)
    u = np.concatenate([generator.uniform(-level, level, (columns, inputs)) for level in levels])
    return factors, u[:, np.newaxis]


def sphere_mesh(count: int) -> FloatArray:
    """``count`` = n² points (count, 3) of the unit sphere on n latitudes × n longitudes, poles on the last axis.

    Each pole comes n times and the meridian where longitudes meet twice, as mesh functions draw it.
    """
    n = math.isqrt(count)
    latitude, longitude = np.linspace(-np.pi / 2, np.pi / 2, n), np.linspace(0, 2 * np.pi, n)
    ring, height = np.cos(latitude), np.sin(latitude)
    ring[[0, -1]] = 0.0  # repeated points are equal to the last bit
    east, north = np.cos(longitude), np.sin(longitude)
    east[-1], north[-1] = east[0], north[0]
    points = np.stack([np.outer(ring, east), np.outer(ring, north), np.repeat(height, n).reshape(n, n)], axis=-1)
    return points.reshape(-1, 3)


def fibonacci_mesh(count: int) -> FloatArray:
    """``count`` points (count, 3) of the unit sphere on a spiral, each with nearly the same area around it."""
    i = np.arange(count)
    z = 1 - (2 * i + 1) / count
    angle = np.pi * (3 - np.sqrt(5)) * i
    ring = np.sqrt(1 - z**2)
    return np.stack([ring * np.cos(angle), ring * np.sin(angle), z], axis=-1)


def check_mesh(mesh: str, count: int) -> None:
    """Raise ``InvalidValueError`` for a ``count`` that the ``mesh`` cannot have."""
    if mesh == "sphere" and math.isqrt(count) ** 2 != count:
        raise InvalidValueError(
            f"'sample.count' must be a square such as 441 = 21² for the mesh 'sphere', got {count}: "
            "choose one, or the mesh 'fibonacci'"
        )


def semi_axes(energy: float, m: float, Jzz: float) -> FloatArray:
    """Largest v_x, v_y, yaw rate (3,) of a body of mass ``m`` and yaw inertia ``Jzz`` with the kinetic ``energy``."""
    return np.sqrt(2 * energy / np.array([m, m, Jzz]))


def shells(points: FloatArray, count: int) -> FloatArray:
    """The ``points`` (n, 3) of the unit sphere on ``count`` surfaces of even radii, the outermost first."""
    radii = np.linspace(1, SMALLEST_SHELL, count) if count > 1 else np.ones(1)
    return np.concatenate([radius * points for radius in radii])


MESHES: dict[str, Callable[[int], FloatArray]] = {"sphere": sphere_mesh, "fibonacci": fibonacci_mesh}


def ball(seed: int, count: int) -> FloatArray:
    """``count`` points (count, 3) uniform in the volume of the unit ball: directions first, then radii."""
    generator = np.random.default_rng(seed)
    direction = generator.standard_normal((count, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    points: FloatArray = direction * generator.random((count, 1)) ** (1 / 3)
    return points


def _uniform(generator: np.random.Generator, box: Sequence[float], count: int) -> FloatArray:
    return np.asarray(generator.uniform(-1, 1, (count, len(box))) * np.asarray(box))


def _product(generator: np.random.Generator, box: Sequence[float], count: int) -> FloatArray:
    values = [_random(generator, half_width, values_per_state(count, len(box))) for half_width in box]
    return np.stack(np.meshgrid(*values, indexing="ij"), axis=-1).reshape(-1, len(box))


def values_per_state(count: int, states: int) -> int:
    """How many values of each of ``states`` make ``count`` of them. Raises ``InvalidValueError`` where none do."""
    side = int(np.rint(count ** (1 / states)))
    if side**states != count:
        raise InvalidValueError(
            f"'test.count' {count} is not the product of equal numbers of values of {states} states, as {side**states} "
            "is: choose such a number, or the layout 'uniform'"
        )
    return side


LAYOUTS: dict[str, Callable[[np.random.Generator, Sequence[float], int], FloatArray]] = {
    "uniform": _uniform,
    "product": _product,
}


def box(
    seed: int,
    box: Sequence[float],
    count: int,
    excitation: str,
    amplitude: float,
    steps: int,
    inputs: int,
    layout: str = "uniform",
) -> tuple[FloatArray, FloatArray]:
    """States in a box, of one of ``LAYOUTS``, with inputs uniform in [-amplitude, amplitude].

    ``excitation``: ``fresh`` draws at each step, ``held`` once for each trajectory, ``none`` gives zeros. Returns
    the states (count, n_x) and the inputs (count, steps or 1, inputs).
    """
    generator = np.random.default_rng(seed)
    states = LAYOUTS[layout](generator, box, count)
    return states, excite(generator, excitation, amplitude, count, steps, inputs)


def drive(
    seed: int,
    count: int,
    speeds: tuple[float, float],
    largest: tuple[float, float, float],
    r_w: float,
    excitation: str,
    magnitudes: tuple[float, float, float],
    steps: int,
) -> tuple[FloatArray, FloatArray]:
    """States of a car on wheels of radius ``r_w`` in m, uniform in v_x between ``speeds`` and in v_y, yaw rate and the
    slip of either axle within ± ``largest``, with uniform inputs.

    ``magnitudes``: of torque in N m, which drives or brakes, and of front and rear steer in rad. Returns the states
    (count, 5) and the inputs (count, steps or 1, 6) of the plant ``wheels``.
    """
    generator = np.random.default_rng(seed)
    v_y, yaw_rate, slip = largest
    v_x = generator.uniform(*speeds, count)
    around = generator.uniform(-1, 1, (count, 4)) * [v_y, yaw_rate, slip, slip]
    states = np.column_stack([v_x, around[:, :2], v_x[:, np.newaxis] * (1 + around[:, 2:]) / r_w])
    drawn = excite(generator, excitation, 1.0, count, steps, 4)
    torque, steer, steer_rear = magnitudes
    u = np.empty((*drawn.shape[:2], 6))
    u[..., 0], u[..., 3] = steer * drawn[..., 0], steer_rear * drawn[..., 2]
    turning = torque * drawn[..., 1::2]
    u[..., 1::3], u[..., 2::3] = np.maximum(turning, 0.0), np.maximum(-turning, 0.0)
    return states, u


def excite(
    generator: np.random.Generator, excitation: str, amplitude: float, count: int, steps: int, inputs: int
) -> FloatArray:
    """Inputs (count, steps or 1, inputs) of ``count`` trajectories, uniform in [-amplitude, amplitude] or zero."""
    if excitation == "none":
        return np.zeros((count, 1, inputs))
    held_steps = steps if excitation == "fresh" else 1
    drawn: FloatArray = amplitude * generator.uniform(-1, 1, (count, held_steps, inputs))
    return drawn
