"""Sampling designs. Every draw comes from one seeded generator, in a fixed order, so that a seed pins a dataset."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from koopcli.records import FloatArray

Draw = Callable[[np.random.Generator, float, int], FloatArray]


def _random(generator: np.random.Generator, half_width: float, count: int) -> FloatArray:
    return np.sort(generator.uniform(-half_width, half_width, count))


def _even(generator: np.random.Generator, half_width: float, count: int) -> FloatArray:
    return np.linspace(-half_width, half_width, count)


DRAWS: dict[str, Draw] = {"random": _random, "even": _even}


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


def box(
    seed: int, box: Sequence[float], count: int, excitation: str, amplitude: float, steps: int, inputs: int
) -> tuple[FloatArray, FloatArray]:
    """States uniform in a box with inputs uniform in [-amplitude, amplitude].

    ``excitation``: ``fresh`` draws at each step, ``held`` once for each trajectory, ``none`` gives zeros. Returns
    the states (count, n_x) and the inputs (count, steps or 1, inputs).
    """
    generator = np.random.default_rng(seed)
    states = generator.uniform(-1, 1, (count, len(box))) * np.asarray(box)
    if excitation == "none":
        return states, np.zeros((count, 1, inputs))
    held_steps = steps if excitation == "fresh" else 1
    return states, amplitude * generator.uniform(-1, 1, (count, held_steps, inputs))
