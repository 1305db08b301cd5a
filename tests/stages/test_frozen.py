"""A store that the first code of this format wrote: read, verified, and known by the same keys."""

from __future__ import annotations

import shutil
from dataclasses import replace

import pytest

from koopcli.stages.base import Task
from koopcli.stages.recorded import content_of, recipe_of, settings_of
from koopcli.stages.registry import STAGES
from koopcli.stages.repair import opens
from koopcli.store import Store, digests
from koopcli.store.identity import data_digest, key_of, plain
from koopcli.store.pins import pins
from koopcli.store.verify import verify
from tests.stages.frozen import STORE, tasks

LATER = {"import", "select", "score", "predict", "control"}  # stages younger than this store


@pytest.fixture(scope="module")
def frozen(tmp_path_factory):
    """A copy, which a failing read cannot change."""
    return Store(shutil.copytree(STORE, tmp_path_factory.mktemp("frozen") / "store"))


def records(store):
    return {f"{stage}/{key}": store.record(stage, key) for stage, key in store.index()}


def test_it_has_something_of_every_stage(frozen):
    assert {record.stage for record in records(frozen).values()} == STAGES.keys() - LATER
    assert set(pins(frozen)["kept"]) == records(frozen).keys()


def test_nothing_of_it_is_damaged(frozen):
    report = verify(frozen, opens)
    assert [finding.what for finding in report.findings] == []


def test_everything_is_read_and_holds_what_it_held(frozen):
    for record in records(frozen).values():
        assert data_digest(frozen.read(record)) == record.data
        packed = content_of(record, frozen).pack()
        if record.recipe["version"] == STAGES[record.stage].version:
            assert data_digest(packed) == record.data


def of_today(store):
    """The records of stages that are at their versions still: a raised version may have other defaults."""
    return {full: r for full, r in records(store).items() if r.recipe["version"] == STAGES[r.stage].version}


def test_its_settings_give_its_keys(frozen):
    known = records(frozen)
    for full, record in of_today(frozen).items():
        inputs = {role: known[name] for role, name in record.lineage.items()}
        recipe = recipe_of(Task(record.stage, settings_of(record)), inputs)
        assert f"{record.stage}/{key_of(recipe)}" == full


def test_what_is_asked_for_as_then_is_planned_as_then(frozen):
    """Settings, kinds and stages may have been added since."""
    known = [record.recipe for record in of_today(frozen).values()]
    stages = {recipe["stage"] for recipe in known} - {"plot"}  # whose code is in its settings
    for task in tasks():
        for step in task.upstream():
            if step.stage in stages:
                alike = [old["settings"] for old in known if old["stage"] == step.stage]
                assert recipe_of(step, {})["settings"] in alike


def test_a_default_that_has_changed_since_changes_no_record(frozen):
    """A recipe says nothing of what was at its default; the record says all."""
    (fit,) = [r for r in records(frozen).values() if r.recipe["settings"].get("terms") == "generator"]
    assert "ridge" not in fit.recipe["settings"]
    assert settings_of(fit).ridge == fit.settings["ridge"]
    assert settings_of(replace(fit, settings={**fit.settings, "ridge": 0.5})).ridge == 0.5
    for record in of_today(frozen).values():
        assert record.settings.keys() <= plain(settings_of(record)).keys(), "every setting, and none that is gone"
        assert record.recipe["settings"].keys() <= record.settings.keys()


def test_the_size_from_which_objects_have_slabs_is_part_of_the_format():
    assert (digests.WHOLE, digests.SLAB) == (32 << 20, 1 << 20), "what is stored is verified by these"
