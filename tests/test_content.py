"""Records are equal where they hold the same, whatever holds it, and are shown without their arrays."""

from __future__ import annotations

from dataclasses import dataclass, replace

import h5py
import numpy as np
import pytest

import koopcli
from koopcli import content, stages, store
from koopcli.blocks import Joined
from koopcli.content import Content
from koopcli.koopman import stored
from koopcli.koopman.edmd import fit as edmd
from koopcli.koopman.predictor.dynamics.bilinear import Bilinear
from koopcli.koopman.scores.evaluation import evaluate
from tests.conftest import box_sample, grid_sample, trajectories_of


@dataclass(frozen=True, eq=False, repr=False)
class Held(Content):
    """One of everything."""

    values: object
    unit: str = "m"
    beside: object = None


A = np.array([[1.0, np.nan, np.inf], [0.0, -2.0, 3.0]])


@pytest.mark.parametrize(
    ("one", "other", "equal"),
    [
        (Held(A), Held(A.copy()), True),
        (Held(A), Held(np.where(np.isnan(A), 0, A)), False),
        (Held(A), Held(np.nextafter(A, 9)), False),
        (Held(A), Held(A[:1]), False),
        (Held(A), Held(A.ravel()), False),
        (Held(A), Held(None), False),
        (Held(A), Held(A, "km"), False),
        (Held(A > 0), Held(A > 0), True),
        (Held(np.array(["a"])), Held(np.array(["b"])), False),
        (Held(np.empty((0, 3))), Held(np.empty((0, 3))), True),
        (Held((A, 1)), Held((A.copy(), 1)), True),
        (Held((A,)), Held((A, A)), False),
        (Held({"a": A}), Held({"a": A.copy()}), True),
        (Held({"a": A}), Held({"b": A}), False),
        (Held(Held(A)), Held(Held(A.copy())), True),
        (Held(Held(A)), Held(Held(A, "km")), False),
        (Held(np.nan), Held(float("nan")), True),
        (Held(np.nan), Held(1.0), False),
        (Held(1), Held("1"), False),
    ],
)
def test_equality(one, other, equal):
    assert (one == other) is equal
    assert (other == one) is equal
    assert (one != other) is not equal


def test_of_another_kind_nothing_is_equal():
    assert Held(1.0) != 1.0
    assert Held(A) is not None
    assert [Held(A)] != [A.shape]


def test_arrays_on_disk_or_put_together_are_read_in_parts(tmp_path, monkeypatch):
    monkeypatch.setattr(content, "READ", 6)
    values = np.arange(60.0).reshape(20, 3)
    with h5py.File(tmp_path / "x.h5", "w") as file:
        file["x"] = values
        together = Joined([values[:7], values[7:]])
        for one in (file["x"], together):
            assert Held(values) == Held(one)
            assert Held(one) == Held(together)
        file["x"][19, 2] = 0.0
        assert Held(values) != Held(file["x"])


def test_what_can_change_is_no_key():
    with pytest.raises(TypeError, match="unhashable type: 'Held'"):
        hash(Held(A))


def test_a_record_is_shown_by_its_shapes():
    shown = repr(Held((A, Held(A)), "m" * 100, {"a": 1, "b": 2}))
    assert shown == f"Held(values=(array 2 × 3, Held(…)), unit='{'m' * 38}…, beside={{2 facts}})"


def test_records_of_every_day_in_three_lines(plant):
    sample = grid_sample(count=7, columns=3)
    assert repr(sample).startswith("Sample: 343 states × 12 rows of inputs\n  states v_x (m/s), v_y (m/s), ")
    data = trajectories_of(plant, sample, 1)
    assert repr(data).startswith("Trajectories: 4116 × 1 steps of 0.01 s\n  states v_x (m/s), ")
    predictor = edmd.fit(data, edmd.FitEdmd.of(basis="tensor", order=3).basis_from(data))
    assert repr(predictor).startswith(
        "Predictor: linear, 64 functions (Polynomial), steps of 0.01 s\n  states v_x (m/s)"
    )
    assert "spectral_radius" not in vars(predictor)  # which costs as much as a small fit
    again = stored.predictor(replace(predictor).pack())
    assert "spectral radius 1.0" in repr(again)
    assert again == predictor
    assert replace(again, dynamics=replace(again.dynamics, A=again.dynamics.A + 1e-15)) != predictor
    dynamics = Bilinear(predictor.dynamics.A, predictor.dynamics.B, np.zeros((4, 64, 64)))
    bilinear = replace(predictor, dynamics=dynamics, horizon=9)
    assert repr(bilinear).startswith("Predictor: bilinear, 64 functions (Polynomial), steps of 0.01 s, 9 at most\n")
    test = trajectories_of(plant, box_sample(20), 5)
    scored = evaluate(predictor, test, slice(None), 1)
    assert repr(scored).startswith("Evaluation: 20 predictions of 5 steps, RMSE mean ")
    assert scored == evaluate(predictor, test, slice(None), 1)


@pytest.mark.parametrize("package", [koopcli, stages, store])
def test_what_is_public_is_named(package):
    assert all(hasattr(package, name) for name in package.__all__)
