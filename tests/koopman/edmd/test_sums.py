"""Passes over the data: the same however they are cut, merged or sent, and whichever way the Gram matrix is summed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from koopcli.errors import InvalidValueError
from koopcli.koopman.edmd import blockwise, regression, sums
from koopcli.koopman.edmd import fit as edmd
from koopcli.koopman.edmd import survey as survey_module
from koopcli.koopman.edmd.blockwise import PASSES
from koopcli.koopman.edmd.inputs import WhiteInputs, white_inputs
from koopcli.koopman.edmd.passes import here, pack_found, unpack_found
from koopcli.koopman.edmd.survey import add_inputs, survey
from koopcli.koopman.edmd.transitions import Transitions
from koopcli.progress import silent
from tests.conftest import box_sample, trajectories_of

METHODS = {
    "linear": edmd.FitEdmd(),
    "bilinear": edmd.FitEdmd.of(terms="bilinear"),
    "ridge": edmd.FitEdmd.of(ridge=1e-3),
}


@pytest.fixture(scope="module")
def data(plant):
    return trajectories_of(plant, box_sample(300), 7)


@pytest.fixture(scope="module")
def basis(data):
    return edmd.FitEdmd.of(basis="tensor", order=2).basis_from(data)


def in_parts(data, size):
    """Passes over parts of ``size``, each packed and unpacked as for another process."""
    pairs = Transitions.of(data)

    def over(work):
        packed = work.pack()
        again = PASSES[packed.meta["kind"]](packed)
        for start in range(0, len(pairs), size):
            yield unpack_found(pack_found(again(pairs, slice(start, min(start + size, len(pairs))), silent)))

    return over


@pytest.mark.parametrize("rows", [1, 3, 7, 20, 64, 10_000])
@pytest.mark.parametrize("span", [slice(0, 2100), slice(5, 6), slice(3, 1999), slice(700, 1400)])
def test_spans_hold_every_pair_once_whatever_they_cut(data, rows, span):
    x = np.asarray(data.x)
    whole = (x[:, :-1].reshape(-1, 3), np.asarray(data.u).reshape(-1, 4), x[:, 1:].reshape(-1, 3))
    found = list(Transitions.of(data).blocks(rows, span))
    assert max(len(block[0]) for block in found) <= rows
    for part, expected in zip(zip(*found, strict=True), whole, strict=True):
        assert (np.concatenate(part) == expected[span]).all()


def test_several_records_are_numbered_through(data, plant):
    other = trajectories_of(plant, box_sample(11), 3)
    both = Transitions.of([data, other])
    assert len(both) == 300 * 7 + 11 * 3
    alone = [np.concatenate([x for x, *_ in Transitions.of(one).blocks(50)]) for one in (data, other)]
    for span in (slice(0, 2133), slice(2000, 2110), slice(2101, 2133)):
        found = np.concatenate([x for x, *_ in both.blocks(50, span)])
        assert (found == np.concatenate(alone)[span]).all()


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("size", [137, 1000])
def test_a_fit_in_parts_is_the_fit_of_the_whole(data, basis, method, size):
    whole = edmd.fit(data, basis, METHODS[method])
    parts = edmd.fit(data, basis, METHODS[method], over=in_parts(data, size))
    for name in ("A", "B", "N"):
        one, two = getattr(whole.dynamics, name, None), getattr(parts.dynamics, name, None)
        assert (one is None and two is None) or two == pytest.approx(one, rel=1e-9, abs=1e-10 * np.abs(one).max())
    assert (parts.coverage.domain == whole.coverage.domain).all()
    assert (parts.coverage.states == whole.coverage.states).all()
    assert parts.regression.condition == pytest.approx(whole.regression.condition, rel=1e-6)


@pytest.mark.parametrize("method", METHODS)
def test_every_way_of_solving_gives_the_same(data, basis, method, monkeypatch):
    found = {}
    for way in ("moments", "entries", "QR"):
        monkeypatch.setattr(blockwise, "moments_pay", lambda of, way=way: way == "moments")
        monkeypatch.setattr(regression, "GRAM_CONDITION", 0.0 if way == "QR" else 1e6)
        monkeypatch.setattr(blockwise, "GRAM_CONDITION", 0.0 if way == "QR" else 1e6)
        found[way] = edmd.fit(data, basis, METHODS[method], over=in_parts(data, 999))
    assert [one.regression.solved_by for one in found.values()] == ["moments", "normal equations", "QR"]
    for name in ("A", "B", "N"):
        best = getattr(found["QR"].dynamics, name, None)
        for way in ("moments", "entries"):
            value = getattr(found[way].dynamics, name, None)
            assert (value is None and best is None) or value == pytest.approx(
                best, rel=1e-8, abs=1e-9 * np.abs(best).max()
            )


def test_lost_digits_of_moments_are_measured_and_the_entries_summed_instead(data, basis, monkeypatch):
    """Moments that are off by more than rounding are found out by one block, and given up."""
    right = edmd.fit(data, basis)
    monkeypatch.setattr(blockwise, "moments_pay", lambda of: True)
    products = basis.products
    off = replace(products, linear=tuple(c * (1 + 1e-7 * np.arange(c.size).reshape(c.shape)) for c in products.linear))
    monkeypatch.setitem(vars(basis), "products", off)
    found = edmd.fit(data, basis)
    assert found.regression.solved_by == "normal equations"
    assert pytest.approx(right.dynamics.A, rel=1e-9, abs=1e-12) == found.dynamics.A


def test_a_harmful_condition_goes_to_qr_by_itself(plant):
    """States that keep close to a surface leave the normal equations without their digits; the rank stays whole."""
    rng = np.random.default_rng(5)
    sample = box_sample(400)
    x0 = sample.states.copy()
    x0[:, 1] = x0[:, 0] * (1 + 1e-5 * rng.standard_normal(len(x0)))
    data = trajectories_of(plant, replace(sample, states=x0), 1)
    found = edmd.fit(data, edmd.FitEdmd.of(basis="total", order=2).basis_from(data))
    assert found.regression.solved_by == "QR"
    assert found.regression.rank == found.regression.directions == 14
    assert found.regression.condition > 1e4
    x, u, x_next = next(Transitions.of(data).blocks(400))
    V = np.hstack([found.lift(x), u / 1e4])
    best = V @ np.linalg.lstsq(V, x_next, rcond=1e-13)[0]
    by_normal_equations = V @ np.linalg.solve(V.T @ V, V.T @ x_next)
    assert found.step(x, u) == pytest.approx(best, abs=1e-5)  # rounding leaves 3e-7 at a condition of 4e10
    assert np.abs(by_normal_equations - best).max() > 1e-3


def test_several_records_are_fitted_as_one(data, plant, basis):
    both = trajectories_of(plant, box_sample(300), 7)
    halves = [replace(both, x=both.x[rows], u=both.u[rows], course=None) for rows in (slice(0, 100), slice(100, 300))]
    one, two = edmd.fit(replace(both, course=None), basis), edmd.fit(halves, basis)
    assert pytest.approx(one.dynamics.A, rel=1e-9, abs=1e-12) == two.dynamics.A
    assert pytest.approx(one.dynamics.B, rel=1e-9, abs=1e-12) == two.dynamics.B


def test_records_that_differ_are_not_fitted_together(data):
    for changed, what in (
        (replace(data, dt=0.02), "sampling period"),
        (replace(data, plant={"plant": "other"}), "vehicle or plant"),
    ):
        with pytest.raises(InvalidValueError, match=what):
            Transitions.of([data, changed])


@pytest.mark.parametrize("still", [5e3, 0.1, np.pi, 1e-9, 0.0])
def test_inputs_are_made_white_from_one_triangle(still):
    """However many blocks go into it: the rounding of an input that stands still adds up, and is no input."""
    rng = np.random.default_rng(6)
    u = 5 + rng.standard_normal((40_000, 3)) @ rng.standard_normal((3, 3))
    u[:, 1] = still
    triangle = np.empty((0, 4))
    for start in range(0, len(u), 199):
        triangle = add_inputs(triangle, u[start : start + 199])
    ends = np.stack([u.min(axis=0), u.max(axis=0)])
    white = white_inputs(triangle, ends, centred=True)
    assert white.mean == pytest.approx(u.mean(axis=0), rel=1e-12)
    assert white.moving.tolist() == [True, False, True]
    w = white(u)
    assert w.shape == (40_000, 2)
    assert w.mean(axis=0) == pytest.approx([0, 0], abs=1e-12)
    assert w.T @ w / len(u) == pytest.approx(np.eye(2), abs=1e-12)
    about_zero = white_inputs(triangle, ends, centred=False)
    used = 3 if still else 2
    assert about_zero(u).T @ about_zero(u) / len(u) == pytest.approx(np.eye(used), abs=1e-9)
    again = WhiteInputs.unpack(white.pack())
    assert (again(u) == w).all()


@pytest.mark.parametrize("still", [5e3, 0.1])
def test_an_input_that_stands_still_through_many_blocks_moves_nothing(plant, still, monkeypatch):
    monkeypatch.setattr(survey_module, "READ", 50)
    sample = box_sample(3000)
    inputs = sample.inputs.copy()
    inputs[..., 2] = still
    data = trajectories_of(plant, replace(sample, inputs=inputs), 1)
    found = edmd.fit(data, edmd.FitEdmd.of(basis="total", order=1).basis_from(data))
    assert found.regression.rank == found.regression.directions == 7
    assert not found.dynamics.B[:, 2].any()
    assert found.regression.condition < 10


def test_a_survey_in_parts_is_the_survey(data):
    pairs = Transitions.of(data)
    whole, parts = survey(pairs, here(pairs)), survey(pairs, in_parts(data, 333))
    assert (whole.states == parts.states).all()
    assert np.abs(parts.triangle) == pytest.approx(np.abs(whole.triangle), rel=1e-10, abs=1e-9)


def test_memory_is_that_of_a_block(monkeypatch, data, basis):
    """No pass ever holds more rows than are read together, however many there are."""
    largest = []
    real = Transitions.blocks

    def spy(self, rows, span=None):
        for block in real(self, rows, span):
            largest.append(len(block[0]))
            yield block

    monkeypatch.setattr(Transitions, "blocks", spy)
    monkeypatch.setattr(sums, "READ", 64)
    edmd.fit(data, basis, seen=survey(Transitions.of(data), here(Transitions.of(data))))
    assert sorted(set(largest))[-2] <= 64  # but for the survey's own
