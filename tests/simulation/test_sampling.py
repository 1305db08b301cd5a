from __future__ import annotations

import numpy as np
import pytest

from koopcli.simulation import sampling

BOX = (30.0, 30.0, 10.0)


def test_the_grid_is_drawn_in_its_pinned_order():
    factors, u = sampling.grid(5, BOX, 15, "random", (1.0, 5.0, 10.0, 100.0), 15, 4)
    g = np.random.default_rng(5)
    for factor, half_width in zip(factors, BOX, strict=True):
        assert (factor == np.sort(g.uniform(-half_width, half_width, 15))).all()
    for i, level in enumerate((1.0, 5.0, 10.0, 100.0)):
        assert (u[15 * i : 15 * (i + 1), 0] == g.uniform(-level, level, (15, 4))).all()
    assert u.shape == (60, 1, 4)


def test_even_values_take_nothing_from_the_generator():
    factors, u = sampling.grid(5, BOX, 15, "even", (1.0,), 15, 4)
    assert (factors[2] == np.linspace(-10, 10, 15)).all()
    assert (u[:, 0] == np.random.default_rng(5).uniform(-1, 1, (15, 4))).all()


@pytest.mark.parametrize(("excitation", "steps"), [("fresh", 30), ("held", 1), ("none", 1)])
def test_the_box_has_the_same_states_whatever_its_inputs(excitation, steps):
    x0, u = sampling.box(7, BOX, 100, excitation, 1e4, 30, 4)
    g = np.random.default_rng(7)
    assert (x0 == g.uniform(-1, 1, (100, 3)) * [30, 30, 10]).all()
    assert u.shape == (100, steps, 4)
    if excitation == "none":
        assert not u.any()
    else:
        assert (u == 1e4 * g.uniform(-1, 1, u.shape)).all()
