"""A stage whose result changes must change its version, or the store would serve stale results."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from koopcli.simulation import integrate
from koopcli.stages.registry import STAGES
from tests.stages.toys import PINS, TOYS, complaint


@pytest.fixture
def pins():
    return json.loads(PINS.read_text())


def test_every_stage_has_a_toy():
    assert TOYS.keys() == STAGES.keys()


@pytest.mark.parametrize("stage", STAGES)
def test_results_and_versions_agree(stage, pins):
    assert complaint(stage, pins) is None


def test_a_changed_result_without_a_changed_version_is_found(pins, monkeypatch):
    monkeypatch.setattr(integrate, "rk4_step", lambda rhs, x, u, dt: x + dt * rhs(x, u))
    assert "raise its version" in complaint("simulate", pins)
    assert complaint("fit-edmd", pins) is None  # toys are made by no other stage


@pytest.mark.parametrize("stage", STAGES)
def test_a_small_change_of_any_stage_is_found(stage, pins, monkeypatch):
    """One array off by a thousandth of a percent: enough for every stage."""

    class Off:
        def __init__(self, made):
            self.made = made

        def __getattr__(self, name):
            return getattr(self.made, name)

        def __len__(self):
            return len(self.made)

        def pack(self):
            packed = self.made.pack()
            name = max(packed.arrays, key=lambda n: packed.arrays[n].values.size if n != "image" else 0)
            array = packed.arrays[name]
            return replace(packed, arrays={**packed.arrays, name: replace(array, values=array.values * (1 + 1e-5))})

    real = STAGES[stage]
    monkeypatch.setitem(STAGES, stage, replace(real, run=lambda *args: Off(real.run(*args))))
    assert "raise its version" in complaint(stage, pins)


def test_a_changed_figure_is_found_too(pins, monkeypatch):
    """What scripts read is pinned as well as the arrays."""
    from koopcli.koopman import operators

    monkeypatch.setattr(operators, "condition_number", lambda values: 2.0 * values.max() / values.min())
    assert "raise its version" in complaint("fit-edmd", pins)


def test_a_new_version_asks_for_a_new_pin(pins, monkeypatch):
    monkeypatch.setitem(STAGES, "simulate", replace(STAGES["simulate"], version=99))
    assert "version 99" in complaint("simulate", pins)
